"""From scikit-fuzzy's control systems."""

from importlib.util import find_spec

from fis_tools.errors import MissingExtra

if find_spec("skfuzzy") is None or find_spec("scipy") is None:
    raise MissingExtra(
        "reading scikit-fuzzy's control systems",
        "scikit-fuzzy with scipy",
        "scikit-fuzzy networkx packaging scipy",
    )
