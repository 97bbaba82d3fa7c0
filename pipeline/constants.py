"""Constants of nature, and units: each value stands here alone."""

from typing import Final

#: equatorial radius and gravitational parameter of the Earth (WGS 84)
EARTH_RADIUS_M: Final = 6_378_137.0
EARTH_GRAVITY_M3_S2: Final = 3.986004418e14
#: nominal radius of the Sun (resolution B3 of the International Astronomical Union, 2015)
SUN_RADIUS_M: Final = 695_700_000.0
#: astronomical unit (resolution B2 of the International Astronomical Union, 2012)
ASTRONOMICAL_UNIT_M: Final = 149_597_870_700.0
#: standard gravity (General Conference on Weights and Measures, 1901): the exhaust speed is the specific
#: impulse times this
STANDARD_GRAVITY_M_S2: Final = 9.80665
DAY_S: Final = 86_400.0
MM_PER_M: Final = 1000.0
