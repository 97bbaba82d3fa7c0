"""A tipping system, built with scikit-fuzzy as its users build one.

Import it and compile it::

    from fis_tools.compiler import compile
    from tipping import build_tipping

    tips = compile(build_tipping())
"""

import numpy as np
from skfuzzy import control, trimf


def build_tipping() -> control.ControlSystem:
    """Return a tip in percent from service and quality, each graded from 0 to 10.

    Every call builds variables of its own: scikit-fuzzy's systems share state through their variables.
    """
    quality = control.Antecedent(np.arange(0.0, 10.5, 0.5), "quality")
    service = control.Antecedent(np.arange(0.0, 10.5, 0.5), "service")
    tip = control.Consequent(np.arange(0.0, 26.0), "tip")
    quality.automf(3, names=["spoiled", "decent", "superb"])
    service.automf(3)
    tip["small"] = trimf(tip.universe, [0.0, 0.0, 12.0])
    tip["usual"] = trimf(tip.universe, [4.0, 13.0, 22.0])
    tip["big"] = trimf(tip.universe, [14.0, 25.0, 25.0])
    return control.ControlSystem(
        [
            control.Rule(quality["spoiled"] | service["poor"], tip["small"]),
            control.Rule(service["average"], tip["usual"]),
            control.Rule(quality["superb"] & ~service["poor"], tip["big"] % 0.8),
            control.Rule(service["good"] | quality["superb"], tip["big"]),
        ]
    )
