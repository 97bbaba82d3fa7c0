"""The flight as the paper and the pages write it: plain NumPy and SciPy, a file for each law. Start here.

`period` is one control period: look, decide, act. `pipeline.flight.fly.reference` flies a mission with it
(``+experiment=fly flight=reference``), slowly; the tests fly every kind of mission with it and with the
compiled code of `pipeline.flight.period`, period by period. It shares no formula with that code. Of the
product it reads settings, controllers and starts, which are numbers, and runs the plain inference of
`fis_tools.engines.inference`.

Axes are Hill's (i away from the Earth, j along the track, k along the orbit normal), units SI and radians,
unless a name says otherwise. An attitude is a `scipy.spatial.transform.Rotation` from body to Hill axes, of
the same four numbers as the product's quaternions. Arrays of points have the shape (P, 3), a deputy's state
is its position (m) and velocity (m/s) relative to the chief, shape (6,).

============== =====================================================================================
file           law
============== =====================================================================================
`motion`       Clohessy and Wiltshire's equations, free and forced; the closest approach
`two_body`     the chief's orbit about an oblate Earth, and the deputy beside it
`course`       motion beside a chief on its true course, as the deputy predicts it
`turning`      Euler's equation: the deputy under torques, a chief that tumbles
`light`        the Sun, the Earth's shadow, which points are lit
`mesh`         which parts of a chief hide others
`camera`       which points the camera sees
`guidance`     the target among the candidates: their mean, or the nearest cluster
`navigation`   fixes, and the Kalman filter on them
`signals`      what a controller senses; `urgency`, `foresight`, `see_push` and `tour` are the longer ones
`plans`        what a plan of pushes comes to by geometry
`parking`      the push onto a closed ellipse inside the limits
`thrust`       inference, dead bands, coasting: the force that is requested, and why
`safety`       the least change of a force that keeps the limits
`way_out`      the forces after which one still leads onto a closed ellipse
`fleet`        what several deputies tell one another, and leave to one another
`actuators`    impulses, delays, errors and layouts of thrusters, propellant
`wheels`       what reaction wheels hold
`pointing`     the desired attitude, and the law that turns the deputy to it
============== =====================================================================================
"""
