"""Points spread evenly over a sphere around the chief, shape (P, 3), m, chief axes."""

from math import cos, floor, pi, sin, sqrt

import numpy as np

from pipeline.array_types import Floats


def regular_placement(num_points: int, radius_m: float) -> Floats:
    """Place points on rings of constant latitude at nearly equal distances.

    Deserno's regular placement (M. Deserno, How to generate equidistributed points on the surface of a
    sphere, 2004). It returns about the requested number of points, 99 for 100: ring by ring from +k to -k,
    inside a ring from +i towards +j.
    """
    area = 4.0 * pi / num_points
    num_rings = max(1, floor(pi / sqrt(area) + 0.5))
    azimuth_spacing = area * num_rings / pi
    points = []
    for ring in range(num_rings):
        polar = pi * (ring + 0.5) / num_rings
        num_on_ring = max(1, floor(2.0 * pi * sin(polar) / azimuth_spacing + 0.5))
        for place in range(num_on_ring):
            azimuth = 2.0 * pi * place / num_on_ring
            points.append((sin(polar) * cos(azimuth), sin(polar) * sin(azimuth), cos(polar)))
    return radius_m * np.array(points)


def fibonacci_placement(num_points: int, radius_m: float) -> Floats:
    """Place exactly so many points on a spiral that turns by the golden angle from one to the next.

    They go from +k to -k, the first at azimuth zero (R. Swinbank and R. J. Purser, Quarterly Journal of the
    Royal Meteorological Society 132, 2006).
    """
    place = np.arange(num_points)
    height = 1.0 - (2.0 * place + 1.0) / num_points
    azimuth = place * (pi * (3.0 - sqrt(5.0)))
    across = np.sqrt(1.0 - height * height)
    return radius_m * np.column_stack((across * np.cos(azimuth), across * np.sin(azimuth), height))
