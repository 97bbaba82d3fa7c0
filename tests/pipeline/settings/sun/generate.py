"""Write suns.json: the Sun's direction from the Earth, as astropy has it.

It wants an environment of its own::

    python -m venv sky && sky/bin/pip install astropy==8.0.2
    sky/bin/python tests/pipeline/settings/sun/generate.py

Axes are the true equator and equinox of date; light time and aberration are in it.
"""

import json
from pathlib import Path

from astropy import __version__, units
from astropy.coordinates import TETE, get_sun
from astropy.time import Time
from astropy.utils import iers

iers.conf.auto_download = False
iers.conf.iers_degraded_accuracy = "ignore"
iers.conf.auto_max_age = None

times = [
    f"{year}-{month:02d}-{day:02d}T{hour:02d}:30:00"
    for year, month, day, hour in (
        (1951, 1, 3, 4),
        (1963, 7, 19, 22),
        (1977, 10, 5, 13),
        (1988, 3, 20, 9),
        (1999, 12, 31, 23),
        (2005, 5, 15, 6),
        (2012, 8, 28, 17),
        (2019, 2, 11, 1),
        (2026, 11, 26, 12),
        (2033, 6, 21, 3),
        (2041, 9, 22, 19),
        (2049, 4, 7, 8),
    )
]
rows = {}
for text in times:
    time = Time(text, scale="utc")
    sun = get_sun(time).transform_to(TETE(obstime=time)).cartesian
    x, y, z = (float(part / sun.norm()) for part in sun.xyz.to(units.m))
    rows[text] = [round(x, 9), round(y, 9), round(z, 9)]
table = {"made_by": f"astropy {__version__}, {Path(__file__).name}", "suns": rows}
path = Path(__file__).with_name("suns.json")
path.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
