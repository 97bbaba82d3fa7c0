"""An entry in the registry is all it takes for a shape to be checked, worded, written, read and inferred."""

from collections.abc import Iterator
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from fis_tools.document import text
from fis_tools.engines.compiler import compile
from fis_tools.findings.simplification.draft import rounded
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fcl, fis, fll, fml
from fis_tools.formats.serialize import Kind
from fis_tools.model import (
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    MembershipFunction,
    Rule,
    Sampled,
    Term,
    Variable,
)
from fis_tools.model.shape import SHAPES, Floats, Place, Width, shape
from fis_tools.model.validate import problems
from fis_tools.words.text import outline, shape_words


@shape("cosine_bump", "cosine bump, centre {centre}, half width {width}", fll=("Bump", "width", "centre"))
class CosineBump(MembershipFunction):
    """``(1 + cos(pi (x - centre) / width)) / 2`` within `width` of the `centre`, zero beyond."""

    centre: Place
    width: Width

    def at(self, x: Floats) -> Floats:
        """Evaluate the formula."""
        away = np.minimum(np.abs(x - self.centre) / self.width, 1.0)
        values: Floats = 0.5 * (1.0 + np.cos(np.pi * away))
        return values


del SHAPES["cosine_bump"]  # it is there for these tests alone


@pytest.fixture(autouse=True)
def _entered() -> Iterator[None]:
    SHAPES["cosine_bump"] = CosineBump
    yield
    del SHAPES["cosine_bump"]


def _system(bump: MembershipFunction) -> FuzzySystem:
    """A system that says low where x is near the bump and high where it is near the hill."""
    x = Variable("x", "m", 0.0, 10.0, (Term("bump", bump), Term("hill", Gaussian(8.0, 1.0))), 1001)
    terms = (Term("low", CosineBump(-1.0, 1.0)), Term("high", CosineBump(1.0, 1.0)))
    y = Variable("y", "", -1.0, 1.0, terms, default=0.0)
    rules = (
        Rule(Is("x", "bump"), (Consequent("y", "low"),)),
        Rule(Is("x", "hill"), (Consequent("y", "high"),)),
    )
    return FuzzySystem("s", (x,), (y,), rules)


SYSTEM = _system(CosineBump(4.04, 3.0))
CONTROLLER = FuzzyController("s", (SYSTEM,))
INPUTS = np.linspace(0.0, 10.0, 201)


def test_it_is_checked() -> None:
    assert problems(SYSTEM) == []
    (notes,) = problems(_system(CosineBump(4.0, -3.0)))
    assert notes.endswith("term 'bump': width -3.0 is not positive; give a number above 0")
    (notes,) = problems(_system(CosineBump(np.nan, 3.0)))
    assert notes.endswith("centre, width = (nan, 3.0) must be finite numbers")


def test_it_is_worded() -> None:
    assert shape_words(SYSTEM.inputs[0].terms[0]) == "cosine bump, centre 4.04, half width 3"
    assert "cosine bump, centre 4.04, half width 3" in text.write(outline(CONTROLLER))


def test_it_is_inferred_with() -> None:
    """The centroid of ``(1 + cos(pi (y - 1))) / 2`` from 0 to 1 is ``1/2 + 2 / pi^2``."""
    outputs = compile(SYSTEM)({"x": np.array([8.0])})["y"]
    np.testing.assert_allclose(outputs, 0.5 + 2.0 / np.pi**2, atol=1e-4)


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_our_own_files_hold_it(kind: Kind) -> None:
    text = serialize.dump_json(CONTROLLER) if kind == "json" else serialize.dump_yaml(CONTROLLER)
    assert "cosine_bump" in text
    assert serialize.loads(text, kind) == CONTROLLER


@pytest.mark.parametrize(("kind", "form"), [("fis", fis), ("fll", fll), ("fml", fml)])
def test_other_programs_files_hold_it_or_its_points(kind: Kind, form: ModuleType) -> None:
    written = form.write(CONTROLLER).text
    assert serialize.loads(written, kind) == CONTROLLER
    shown = "\n".join(line for line in written.splitlines() if "fis_tools carries" not in line)
    (system,) = serialize.loads(shown, kind).systems
    membership = system.inputs[0].terms[0].membership
    if kind == "fis":
        assert isinstance(membership, Sampled)
    else:
        assert membership == CosineBump(4.04, 3.0)
    outputs = compile(replace(system, name="s"))({"x": INPUTS})["y"]
    np.testing.assert_allclose(outputs, compile(SYSTEM)({"x": INPUTS})["y"], atol=1e-12)


def test_formats_of_points_hold_its_points() -> None:
    assert "TERM bump := (0.0, 0.0)" in fcl.write(CONTROLLER).text
    assert "double" in source.write(CONTROLLER)


def test_its_numbers_are_rounded() -> None:
    """To tens the width would be zero, so that it keeps another digit."""
    (variable,) = rounded(SYSTEM, {("x", "bump"): 1}).inputs
    assert variable.terms[0].membership == CosineBump(4.0, 3.0)
