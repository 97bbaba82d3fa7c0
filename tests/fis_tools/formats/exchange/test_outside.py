"""Programs that the project did not write load its files and give its outputs.

All sample an output's range at about a thousand points, differently: this project and Octave at 1,001 points
from end to end, this project with the points where a cut crosses a term added; fuzzylite at the middles of
1,000 intervals. The others evaluate an input's membership functions themselves, this project straight lines
between 1,001 points of it. Each errs by the square of a step times a curvature: some 1e-6 of the range, 1e-5
for steep sigmoids. Largest measured: fuzzylite 3.1e-5, Octave 8.1e-6. A corner of a membership function that
lies between two points errs by the step itself, 1e-3 of the range at most: so do the corners of Octave's own
file, where 1.8e-4 was measured. A wrong number, weight or rule moves outputs by 1e-2 and more.
"""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fcl, fis, fll
from fis_tools.model import FuzzySystem
from tests.fis_tools.engines.random_systems import otherwise
from tests.fis_tools.formats.exchange.outside import NUM_POINTS, Floats, fuzzylite_outputs, octave_outputs
from tests.fis_tools.formats.exchange.systems import alone, fine, flat_system, nested_system
from tests.fis_tools.sample_controllers import force_x_system
from tests.places import PROJECT
from tests.programs import library

TOLERANCE = 5e-5
TOLERANCE_BETWEEN_POINTS = 1e-3

EXAMPLES = PROJECT / "docs" / "examples"
OCTAVES_OWN = "/usr/share/octave/packages/fuzzy-logic-toolkit-0.4.6/mamdani_tip_calculator.fis"


def systems() -> dict[str, FuzzySystem]:
    found = {
        "paper": force_x_system(),
        "climate": flat_system(),
        "product": flat_system("product", "probabilistic_sum"),
        "nested": nested_system(),
        "tipper": serialize.load(EXAMPLES / "tipper.fis").systems[0],
        "dimmer": serialize.load(EXAMPLES / "dimmer.fll").systems[0],
    }
    return {name: fine(system, NUM_POINTS) for name, system in found.items()}


def assert_near(system: FuzzySystem, ours: Floats, theirs: Floats, tolerance: float = TOLERANCE) -> None:
    assert theirs.shape == ours.shape
    widths = np.array([output.maximum - output.minimum for output in system.outputs])
    assert np.ptp(ours, axis=0).min() > 0.1 * widths.min()
    assert (np.abs(ours - theirs) / widths).max() < tolerance


@pytest.mark.slow
def test_octave_evaluates_our_files_as_we_do(tmp_path: Path) -> None:
    """Octave takes some 40 ms for a rule of a sample, so these are few."""
    chosen = {name: systems()[name] for name in ("paper", "climate", "product", "tipper")}
    counts = {"paper": 4, "climate": 6, "product": 6, "tipper": 8}
    files = {name: tmp_path / f"{name}.fis" for name in chosen}
    for name, system in chosen.items():
        files[name].write_text(fis.write(alone(system)).text, encoding="utf-8")
    inputs = {name: spread_inputs(system, counts[name]) for name, system in chosen.items()}
    # two files that Octave's authors and MATLAB's documentation made, as they are
    files["as it is"] = EXAMPLES / "tipper.fis"
    files["octaves"] = library(OCTAVES_OWN, "octave-fuzzy-logic-toolkit")
    for name in ("as it is", "octaves"):
        chosen[name] = fine(serialize.load(files[name]).systems[0], NUM_POINTS)
        inputs[name] = spread_inputs(chosen[name], 5)
    theirs = octave_outputs(files, inputs, tmp_path)
    for name, system in chosen.items():
        tolerance = TOLERANCE_BETWEEN_POINTS if name == "octaves" else TOLERANCE
        assert_near(system, compile(system)(inputs[name]), theirs[name], tolerance)


@pytest.mark.parametrize(
    ("name", "form"),
    [
        (name, form)
        for name in ("paper", "climate", "product", "nested", "tipper", "dimmer")
        for form in (fis, fll, fcl)
        # the dimmer's rules combine in two ways, which a .fis file cannot say
        if (name, form) != ("dimmer", fis)
    ],
)
def test_fuzzylite_evaluates_our_files_as_we_do(tmp_path: Path, name: str, form: ModuleType) -> None:
    system = systems()[name]
    inputs = spread_inputs(system, 300)
    path = tmp_path / f"{name}.{form.__name__.rpartition('.')[2]}"
    path.write_text(form.write(alone(system)).text, encoding="utf-8")
    assert_near(system, compile(system)(inputs), fuzzylite_outputs(path, inputs, tmp_path))


@pytest.mark.slow
def test_fuzzylite_implies_and_aggregates_as_we_do(tmp_path: Path) -> None:
    pairs = [
        ("product", "max"),
        ("product", "bounded_sum"),
        ("min", "einstein_sum"),
        ("einstein_product", "max"),
    ]
    pairs += [("hamacher_product", "probabilistic_sum"), ("min", "unbounded_sum")]
    for implication, aggregation in pairs:
        system = otherwise(fine(flat_system(), NUM_POINTS), implication, aggregation)
        inputs = spread_inputs(system, 60)
        path = tmp_path / "engine.fll"
        path.write_text(fll.write(alone(system)).text, encoding="utf-8")
        assert_near(system, compile(system)(inputs), fuzzylite_outputs(path, inputs, tmp_path))


def test_fuzzylite_evaluates_the_dimmer_as_it_is(tmp_path: Path) -> None:
    system = systems()["dimmer"]
    inputs = spread_inputs(system, 300)
    assert_near(system, compile(system)(inputs), fuzzylite_outputs(EXAMPLES / "dimmer.fll", inputs, tmp_path))
