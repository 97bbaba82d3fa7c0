"""Draw a controller's terms as Gaussians: ``python -m benchmarks.gaussian CONTROLLER OUTPUT``.

Each term keeps its centre and is one half where it meets the next, like triangles that partition a range
evenly. Evolution may change such terms, and single rules, in ways that a search for readability excludes: a
front of fuel, points and rule consistency that starts there shows the cost of readability.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fis_tools.analysis.measures import centre
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, Gaussian, Variable

#: distance from a Gaussian's mean at which it is a half, in standard deviations
TO_HALF = math.sqrt(2.0 * math.log(2.0))


def drawn(controller: FuzzyController) -> FuzzyController:
    """Return the controller with Gaussian terms."""
    systems = [
        replace(system, inputs=tuple(map(_drawn, system.inputs)), outputs=tuple(map(_drawn, system.outputs)))
        for system in controller.systems
    ]
    return replace(controller, systems=tuple(systems), name=f"{controller.name}_gaussian")


def _drawn(variable: Variable) -> Variable:
    apart = (variable.maximum - variable.minimum) / (len(variable.terms) - 1)
    terms = [
        replace(term, membership=Gaussian(centre(variable, term), 0.5 * apart / TO_HALF))
        for term in variable.terms
    ]
    return replace(variable, terms=tuple(terms))


def main(words: Sequence[str] | None = None) -> None:
    """Read a controller and write its Gaussian twin."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gaussian", description=__doc__)
    parser.add_argument("controller", type=Path)
    parser.add_argument("output", type=Path)
    options = parser.parse_args(words)
    options.output.write_text(serialize.dump_json(drawn(serialize.load(options.controller))) + "\n")


if __name__ == "__main__":
    main()
