"""A flight written to be read: plain NumPy and SciPy, from the specification and the pages.

It shares no formula with the product, which it is compared with: of the product it reads settings,
controllers and starts, which are numbers. A control period is in `period`: look, decide, act. Axes are
Hill's, units SI and radians, unless a name says otherwise; an attitude is the rotation from body axes to
Hill's (scipy's, of the same four numbers that turn Hill's components into the body's).
"""
