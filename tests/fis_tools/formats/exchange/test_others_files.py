"""Files as other programs write them: hedges, chains, padding, remarks, letters of Latin-1."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.engines.inference import infer
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fis, fll
from fis_tools.model import FuzzyController, FuzzySystem, Hedged, Is, Not, Or, Triangular
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import weighed_systems
from tests.fis_tools.engines.random_systems import otherwise
from tests.fis_tools.formats.exchange.outside import NUM_POINTS, Floats, fuzzylite_outputs, octave_outputs
from tests.fis_tools.formats.exchange.systems import DENIED, FLAT, NESTED, fine, without_comment, written
from tests.fis_tools.sample_controllers import EXAMPLES, FORCE_X
from tests.programs import library

HERE = Path(__file__).parent
OLD_FIS, FLL = ((HERE / name).read_text(encoding="utf-8") for name in ("old.fis", "chain.fll"))


def test_old_fis_files_are_read_and_latin_letters_told(tmp_path):
    path = tmp_path / "old.fis"
    path.write_bytes(OLD_FIS.encode("latin-1"))
    reading = serialize.read(path)
    (system,) = reading.controller.systems
    assert system.name == "caf\u00e9 #1"
    assert "Latin-1" in reading.assumptions[0]
    assert (system.implication, system.outputs[0].aggregation) == ("product", "unbounded_sum")
    assert system.inputs[0].terms[1].membership == Triangular(0.0, 1.0, 1.0)
    strengths = compile(system).firing_strengths(np.array([[0.3]]))
    np.testing.assert_allclose(strengths, [[0.49, 1.0 - 0.3**3]], atol=1e-6)


def test_slips_of_fis_files_are_put_right_and_told():
    """Each slip is one of the files that MathWorks and fuzzylite ship."""
    reading = serialize.read(HERE / "slips.fis")
    (system,) = reading.controller.systems
    assert (system.inputs[0].minimum, system.inputs[0].maximum) == (-np.pi / 4, np.pi / 4)
    assert [term.name for term in system.inputs[0].terms] == ["low", "middle", "high"]
    assert [term.name for term in system.outputs[0].terms] == ["same 1", "same 2"]
    for words in (
        "[Input1] has MF2 twice",
        "[Output1] says NumMFs=1 but has 2 terms",
        "y has 2 terms called 'same'",
        "[System] says NumRules=2 but has 3 rules",
        "z concludes numbers: their weighted average is taken",
    ):
        assert any(words in sentence for sentence in reading.assumptions), words
    y, z = compile(system)(np.array([[0.5]]))[0]
    assert z == pytest.approx(0.5 * 2 + 0.5 * 6)
    assert y == pytest.approx(0.8, abs=1e-9)
    text = (HERE / "slips.fis").read_text()
    with pytest.raises(ControllerFileError, match="/0' is not a finite number"):
        serialize.loads(text.replace("pi/4]", "pi/0]"), "fis")
    (system,) = serialize.loads(text.replace("1, 1 1 (1) : 1", "1, 1e-10 1 (1) : 1"), "fis").systems
    assert [consequent.variable for consequent in system.rules[0].consequents] == ["z"]


def test_the_sign_of_a_width_changes_nothing():
    """Trained systems have deviations below zero, whose square the formulas take."""
    text = (HERE / "denied.fis").read_text(encoding="utf-8").replace("'trimf',[-1 0 1]", "'gaussmf',[0.3 0]")
    systems = [serialize.loads(t, "fis").systems[0] for t in (text, text.replace("[0.3 0]", "[-0.3 0]"))]
    rows = np.array([[-0.4], [0.2], [0.7]])
    np.testing.assert_array_equal(*(compile(system)(rows) for system in systems))


def test_files_of_fuzzylite_5_are_read():
    """Version 5 called aggregation accumulation, implication activation, and lock-previous lock-valid."""
    new = "aggregation: Maximum", "implication: Minimum", "lock-previous: false"
    old = "accumulation: Maximum", "activation: Minimum", "lock-valid: false"
    text = """Engine: dim
InputVariable: ambient
  range: 0 1
  term: dark Triangle 0 0.25 0.5
  term: bright Triangle 0.5 0.75 1
OutputVariable: power
  range: 0 1
  aggregation: Maximum
  defuzzifier: Centroid 200
  default: nan
  lock-previous: false
  term: low Triangle 0 0.25 0.5
  term: high Triangle 0.5 0.75 1
RuleBlock:
  implication: Minimum
  rule: if ambient is dark then power is high
  rule: if ambient is bright then power is low
"""
    older = text
    for now, then in zip(new, old, strict=True):
        assert now in older
        older = older.replace(now, then)
    assert serialize.loads(older, "fll") == serialize.loads(text, "fll")


def test_a_rule_of_matlab_concludes_the_complement_of_a_term():
    """Octave's `evalfis` of the file `denied.fis`: 5.78062451, 5.40011083, 6.22964483."""
    (system,) = serialize.load(HERE / "denied.fis").systems
    assert [term.name for term in system.outputs[0].terms] == ["small", "large", "not small"]
    answers = []
    for x in (0.1, 0.5, 0.8):
        (output,) = infer(system, np.array([x])).outputs
        weights = np.r_[0.5, np.ones(99), 0.5] * output.aggregated  # Octave's ends count by half
        answers.append((weights * output.universe).sum() / weights.sum())
    np.testing.assert_allclose(answers, [5.78062451, 5.40011083, 6.22964483], atol=5e-9)


def test_hedges_in_a_fis_file_of_fuzzylites_are_fuzzylites():
    text = OLD_FIS.replace("-2.3, 2", "2.3, 2")
    for head, strengths in (
        ("", [0.3**3, 0.8**3]),
        ("#Code automatically generated with fuzzylite 6.0.\n", [2 * 0.3**2, 1 - 2 * 0.2**2]),
    ):
        compiled = compile(serialize.loads(head + text, "fis").systems[0])
        fired = compiled.firing_strengths(np.array([[0.3], [0.8]]))[:, 1]
        np.testing.assert_allclose(fired, strengths, atol=1e-6)


def test_chained_fll_hands_on_degrees_of_truth():
    (system,) = serialize.loads(FLL, "fll").systems
    assert system.rules[2].antecedent == Or((Is("x", "low"), Is("x", "any")))
    assert system.rules[3].antecedent == Not(Hedged("somewhat", Is("x", "high")))
    strengths = compile(system).firing_strengths(np.array([[-1.0], [0.1], [0.6]]))
    np.testing.assert_allclose(strengths, [[1, 0, 1, 1], [1, 0, 1, 1], [0.5, 1, 1, 0]], atol=1e-12)


def test_fuzzylite_carries_a_hedge_on_to_what_else_a_rule_concludes():
    """So do its program and pyfuzzylite, whose loops change one strength from conclusion to conclusion."""
    rule = "if x is low and x is any then y is somewhat small and z is very large and z is small"
    text = FLL[: FLL.index("  rule:")] + f"  rule: {rule}\n"
    (system,) = serialize.loads(text, "fll").systems
    strengths = compile(system).firing_strengths(np.array([[0.64]]))
    np.testing.assert_allclose(strengths, [[np.sqrt(0.4), 0.4]], atol=1e-12)
    assert [[c.term for c in rule.consequents] for rule in system.rules] == [["small"], ["large", "small"]]
    written = fll.write(FuzzyController("chain", (system,))).text
    assert "if x is low and x is _any then z is very somewhat small" in written
    assert serialize.loads(written, "fll").systems == (system,)
    with pytest.raises(ControllerFileError, match="and a hedge on what it concludes"):
        serialize.loads(text.replace(rule, f"{rule} with 0.5"), "fll")
    with pytest.raises(ControllerFileError, match="the rule concludes 'not'"):
        serialize.loads(text.replace("somewhat small", "not small"), "fll")


TOLERANCE = 5e-5
OCTAVES_OWN = "/usr/share/octave/packages/fuzzy-logic-toolkit-0.4.6/mamdani_tip_calculator.fis"


NAMED = {
    "paper": FORCE_X,
    "climate": FLAT,
    "product": replace(FLAT, and_operator="product", or_operator="probabilistic_sum"),
    "denied": DENIED,
    "nested": NESTED,
    "tipper": serialize.load(EXAMPLES / "tipper.fis").systems[0],
    "dimmer": serialize.load(EXAMPLES / "dimmer.fll").systems[0],
}
SYSTEMS = {name: fine(system, NUM_POINTS) for name, system in NAMED.items()}


def assert_near(system: FuzzySystem, ours: Floats, theirs: Floats, tolerance: float = TOLERANCE) -> None:
    narrowest = min(output.maximum - output.minimum for output in system.outputs)
    assert np.ptp(ours, axis=0).min() > 0.1 * narrowest
    step_by_step.assert_near(theirs, ours, system, tolerance)


def assert_as_fuzzylite(system: FuzzySystem, path: Path, folder: Path, count: int = 300) -> None:
    """Fuzzylite evaluates a file of a system as we evaluate the system."""
    inputs = spread_inputs(system, count)
    assert_near(system, compile(system)(inputs), fuzzylite_outputs(path, inputs, folder))


@pytest.mark.slow
def test_octave_evaluates_our_files_as_we_do(tmp_path):
    """Octave takes some 40 ms for a rule of a sample, so these are few."""
    counts = {"paper": 2, "climate": 3, "product": 3, "tipper": 4}
    chosen = {name: replace(SYSTEMS[name], name=name) for name in counts}
    files = {name: written(tmp_path, system, fis) for name, system in chosen.items()}
    inputs = {name: spread_inputs(system, counts[name]) for name, system in chosen.items()}
    # two files that Octave's authors and MATLAB's documentation made, as they are
    files["as it is"] = EXAMPLES / "tipper.fis"
    files["octaves"] = library(OCTAVES_OWN, "octave-fuzzy-logic-toolkit")
    for name in ("as it is", "octaves"):
        chosen[name] = fine(serialize.load(files[name]).systems[0], NUM_POINTS)
        inputs[name] = spread_inputs(chosen[name], 5)
    # outputs that are weighed, of systems as others see them
    for name in ("constant", "linear", "constant_sum"):
        files[name] = written(tmp_path, replace(weighed_systems.SYSTEMS[name], name=name), fis)
        visible = without_comment(files[name].read_text(encoding="utf-8"))
        (chosen[name],) = fis.read(visible).controller.systems
        inputs[name] = np.clip(weighed_systems.samples(chosen[name], 6), 0.0, 10.0)
    theirs = octave_outputs(files, inputs, tmp_path)
    tolerances = {"octaves": 1e-3, "constant": 1e-5, "linear": 1e-5, "constant_sum": 1e-5}
    for name, system in chosen.items():
        outputs = compile(system)(inputs[name])
        assert_near(system, outputs, theirs[name], tolerances.get(name, TOLERANCE))


@pytest.mark.parametrize(
    ("name", "form"),
    [
        (name, form)
        for name in SYSTEMS
        for form in (fis, fll)
        # the dimmer's rules combine in two ways, which a .fis file cannot say
        if (name, form) not in {("dimmer", fis), ("nested", fis)}
    ],
)
def test_fuzzylite_evaluates_our_files_as_we_do(tmp_path, name, form):
    assert_as_fuzzylite(SYSTEMS[name], written(tmp_path, SYSTEMS[name], form), tmp_path)


@pytest.mark.slow
def test_fuzzylite_implies_and_aggregates_as_we_do(tmp_path):
    pairs = [("product", "bounded_sum"), ("min", "einstein_sum"), ("einstein_product", "max")]
    pairs += [("hamacher_product", "probabilistic_sum"), ("min", "unbounded_sum")]
    for implication, aggregation in pairs:
        system = otherwise(fine(FLAT, NUM_POINTS), implication, aggregation)
        assert_as_fuzzylite(system, written(tmp_path, system, fll), tmp_path, 60)


def test_fuzzylite_evaluates_the_dimmer_as_it_is(tmp_path):
    assert_as_fuzzylite(SYSTEMS["dimmer"], EXAMPLES / "dimmer.fll", tmp_path)
