"""Controllers to test with: one like the paper's, and one with everything a fuzzy system can have."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fis_tools.formats.serialize import load
from fis_tools.model import FuzzySystem, MembershipFunction, Term, Variable, table_rules
from fis_tools.model.shapes import Gaussian, Triangular
from tests.places import PROJECT

HERE = Path(__file__).parent
FORCE_TERMS = ("NL", "NS", "ZE", "PS", "PL")


def terms(**membership_functions: MembershipFunction) -> tuple[Term, ...]:
    """Terms by name."""
    return tuple(Term(name, function) for name, function in membership_functions.items())


def gaussian_terms(names: tuple[str, ...], low: float, high: float, overlap: float = 0.5) -> tuple[Term, ...]:
    """Evenly spaced Gaussian terms; `overlap` is the standard deviation in units of the spacing."""
    spacing = (high - low) / (len(names) - 1)
    return tuple(
        Term(name, Gaussian(low + index * spacing, overlap * spacing)) for index, name in enumerate(names)
    )


PAPER_LIKE = load(HERE / "paper_like.yaml")
#: 25 rules over two inputs, and 45 over three
FORCE_X, FORCE_Z = PAPER_LIKE.systems
#: rule trees, weights, labels, two outputs, an uneven universe
GENERAL = load(HERE / "room.yaml")
(ROOM,) = GENERAL.systems


#: files that the documentation shows
EXAMPLES = PROJECT / "docs" / "examples"
#: a file of another program's
TIPPER = EXAMPLES / "tipper.fis"
#: the fuzzy controllers that the project ships, by name
SHIPPED = {
    path.stem: path
    for path in sorted((PROJECT / "conf" / "controller").glob("*.yaml"))
    if not re.search("^(kind|path):", path.read_text(encoding="utf-8"), re.MULTILINE)
}


def force(name: str = "force_x") -> Variable:
    return replace(FORCE_X.outputs[0], name=name)


def with_input(system: FuzzySystem, **changes: object) -> FuzzySystem:
    """The same system with its first input changed."""
    first, *others = system.inputs
    return replace(system, inputs=(replace(first, **changes), *others))  # type: ignore[arg-type]


def with_output(system: FuzzySystem, **changes: object) -> FuzzySystem:
    """The same system with its first output changed."""
    first, *others = system.outputs
    return replace(system, outputs=(replace(first, **changes), *others))  # type: ignore[arg-type]


def table_system(
    name: str, inputs: tuple[Variable, ...], output: Variable, words: Sequence[str], **how: str
) -> FuzzySystem:
    """A system whose rules are a full table of the terms that they conclude."""
    return FuzzySystem(name, inputs, (output,), table_rules(inputs, output, list(words)), **how)  # type: ignore[arg-type]


def gapped_system(default: float | None) -> FuzzySystem:
    """Triangles with gaps between them: nothing fires from 0.25 to 0.4, from 0.6 to 0.75."""
    apart = terms(low=Triangular(0, 0, 0.25), middle=Triangular(0.4, 0.5, 0.6), high=Triangular(0.75, 1, 1))
    sides = terms(left=Gaussian(-1.0, 0.2), none=Gaussian(0.0, 0.2), right=Gaussian(1.0, 0.2))
    inputs = tuple(Variable(name, "", 0.0, 1.0, apart, num_points=21) for name in "ab")
    output = Variable("y", "", -1.0, 1.0, sides, num_points=21, default=default)
    return table_system("gapped", inputs, output, ["left", "none", "right"] * 3)


def ramp_system(default: float = 0.5, defuzzifier: str = "centroid") -> FuzzySystem:
    """Low or high along x; two output triangles of area 2h - h^2 when cut at h, centred on -3 and 3."""
    x = Variable("x", "m", 0.0, 1.0, terms(low=Triangular(0, 0, 1), high=Triangular(0, 1, 1)), 101)
    sides = terms(left=Triangular(-4.0, -3.0, -2.0), right=Triangular(2.0, 3.0, 4.0))
    y = Variable("y", "N", -5.0, 5.0, sides, 101, default=default)
    return table_system("ramp", (x,), y, ["left", "right"], defuzzifier=defuzzifier)
