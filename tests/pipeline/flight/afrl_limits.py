"""Values of AFRL's constraints in some states, as run-time-assurance 1.18.6 (PyPI) computes them.

Of `ConstraintMagnitudeStateLimit(0.05, 3 + axis)`, (m/s)^2, and of `ConstraintCWHConicKeepOutZone` with
``fov=pi/3`` and the cone of `inspection_1v1.Inspection3dRTA.get_sun_vector`, its `_phi`, rad.
"""

LIMIT_M_S, HALF_ANGLE_DEG = 0.05, 30.0
#: state (m, m/s), the Sun's angle (rad), what is left along each axis, and to the cone
STATES = (
    ((-52.828, 29.872, 8.729, 0.057, 0.005, -0.028), 0.284, (-0.000749, 0.002475, 0.001716), 0.284907286414),
    (
        (-75.402, -58.585, 97.82, -0.087, -0.004, -0.058),
        4.25,
        (-0.005069, 0.002484, -0.000864),
        1.72826980731,
    ),
    ((-19.635, -110.565, -5.541, -0.029, 0.02, 0.041), 1.428, (0.001659, 0.0021, 0.000819), -0.464300873084),
    ((-76.724, 1.231, -2.254, -0.052, -0.02, -0.055), 1.987, (-0.000204, 0.0021, -0.000525), 1.479245474703),
    ((81.323, -60.207, -7.47, -0.1, 0.014, -0.055), 3.184, (-0.0075, 0.002304, -0.000525), 0.159452480268),
    (
        (-11.23, 42.234, -51.868, -0.055, -0.017, -0.042),
        3.493,
        (-0.000525, 0.002211, 0.000736),
        0.988275276779,
    ),
)
