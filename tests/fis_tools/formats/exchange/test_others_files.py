"""Files as other programs write them: hedges, chains, padding, remarks, letters of Latin-1."""

import importlib.util
import warnings
from types import ModuleType

import numpy as np
import pytest
from skfuzzy import control

from fis_tools.analysis.arrays import spread_inputs
from fis_tools.engines.compiler import compile
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.formats.exchange import fis, fll
from fis_tools.model import FuzzyController, FuzzySystem, Hedged, Is, Not, Or, Triangular
from tests.fis_tools.engines.random_systems import otherwise
from tests.fis_tools.formats.exchange.outside import NUM_POINTS, Floats, fuzzylite_outputs, octave_outputs
from tests.fis_tools.formats.exchange.systems import alone, denied_system, fine, flat_system, nested_system
from tests.fis_tools.sample_controllers import force_x_system
from tests.places import PROJECT
from tests.programs import library

OLD_FIS = """[System]  % a remark
Name='caf\u00e9 #1';
Type='mamdani';
NumInputs=1
NumOutputs=1
NumRules=2
AndMethod=''
OrMethod='max'
ImpMethod='prod'; // another
AggMethod='sum'
DefuzzMethod='centroid'
[Input1]
Name='x'
Range=[0 1];
NumMFs=2
MF1='low':'rampmf',[1 0]; % falls
MF2='high':'trimf',[0 1 1 0]
[Output1]
Name='y'
Range=[0 1]
NumMFs=2
MF1='small':'spikemf',[0.25 1]
MF2='large':'cosinemf',[0.75 0.5]
[Rules]
1.2, 1 (1) : 1   % very
-2.3, 2 (1) : 1
"""


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


SLIPS = """[System]
Name='slips'
Type='hybrid'
NumInputs=1
NumOutputs=2
NumRules=2
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'
[Input1]
Name='x'
Range=[-pi/4 pi/4]
NumMFs=3
MF1='low':'trimf',[-2 -1 0]
MF2='middle':'trimf',[-1 0 1]
MF2='high':'trimf',[0 1 2]
[Output1]
Name='y'
Range=[0 1]
NumMFs=1
MF1='same':'trimf',[0 0.2 0.4]
MF2='same':'trimf',[0.6 0.8 1]
[Output2]
Name='z'
Range=[0 8]
NumMFs=2
MF1='two':'constant',[2]
MF2='six':'constant',[6]
[Rules]
1, 1 1 (1) : 1
2, 2 1 (1) : 1
3, 2 2 (1) : 1
"""


def test_slips_of_fis_files_are_put_right_and_told():
    """Each slip is one of the files that MathWorks and fuzzylite ship."""
    reading = serialize.reads(SLIPS, "fis")
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


def test_hedges_in_a_fis_file_of_fuzzylites_are_fuzzylites():
    text = OLD_FIS.replace("-2.3, 2", "2.3, 2")
    ours = compile(serialize.reads(text, "fis").controller.systems[0])
    theirs = compile(
        serialize.reads(
            f"#Code automatically generated with fuzzylite 6.0.\n{text}", "fis"
        ).controller.systems[0]
    )
    x = np.array([[0.3], [0.8]])
    np.testing.assert_allclose(ours.firing_strengths(x)[:, 1], [0.3**3, 0.8**3], atol=1e-6)
    np.testing.assert_allclose(theirs.firing_strengths(x)[:, 1], [2 * 0.3**2, 1 - 2 * 0.2**2], atol=1e-6)


FLL = """Engine: chain
InputVariable: x
  range: 0 1
  term: low Trapezoid -inf 0.2 0.4 0.8
  term: high Binary 0.5 inf
OutputVariable: y
  range: 0 1
  aggregation: Maximum
  defuzzifier: Centroid 100
  default: nan
  term: small Triangle 0 0.2 0.4
  term: large Arc 0.5 1
OutputVariable: z
  range: 0 1
  aggregation: NormalizedSum
  defuzzifier: Centroid 100
  default: nan
  term: small SemiEllipse 0 0.5
  term: large Concave 0.6 1
RuleBlock:
  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  rule: if x is low then y is small
  rule: if x is high then y is large
  rule: if y is small or x is any then z is large
  rule: if y is not somewhat large then z is small
"""


def test_chained_fll_hands_on_degrees_of_truth():
    text = FLL.replace("not somewhat large", "not large")
    (system,) = serialize.loads(text, "fll").systems
    assert system.rules[2].antecedent == Or((Is("x", "low"), Is("x", "any")))
    assert system.rules[3].antecedent == Not(Is("x", "high"))
    strengths = compile(system).firing_strengths(np.array([[-1.0], [0.1], [0.6]]))
    np.testing.assert_allclose(strengths, [[1, 0, 1, 1], [1, 0, 1, 1], [0.5, 1, 1, 0]], atol=1e-12)


def test_a_hedge_before_what_a_rule_concluded_is_said_of_the_inputs():
    (system,) = serialize.loads(FLL, "fll").systems
    assert system.rules[3].antecedent == Not(Hedged("somewhat", Is("x", "high")))


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


EXAMPLES = PROJECT / "docs" / "examples"


@pytest.mark.parametrize(
    ("name", "num_rules", "inputs", "low", "high"),
    [
        ("tipper.fis", 3, {"service": 1.0, "food": 2.0}, 4.0, 7.0),
        ("tipper.fis", 3, {"service": 9.0, "food": 8.0}, 23.0, 26.0),
        ("dimmer.fll", 4, {"daylight": 0.05, "presence": 1.0}, 0.75, 0.9),
        ("dimmer.fll", 4, {"daylight": 0.95, "presence": 0.9}, 0.0, 0.15),
        ("dimmer.fll", 4, {"daylight": 0.5, "presence": 1.0}, 0.4, 0.6),
    ],
)
def test_files_of_other_programs_say_what_they_are_meant_to(name, num_rules, inputs, low, high):
    controller = serialize.load(EXAMPLES / name)
    (system,) = controller.systems
    assert len(system.rules) == num_rules
    (value,) = compile(system)(np.array([[inputs[variable.name] for variable in system.inputs]]))[0]
    assert low <= value <= high


def tipping() -> ModuleType:
    spec = importlib.util.spec_from_file_location("tipping", EXAMPLES / "tipping.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_tipping_system_of_scikit_fuzzy_is_compiled():
    compiled = compile(tipping().build_tipping())
    samples = spread_inputs(compiled.system, 60)
    ours = compiled(samples)
    simulation = control.ControlSystemSimulation(tipping().build_tipping())
    theirs = []
    for sample in samples:
        for variable, value in zip(compiled.system.inputs, sample, strict=True):
            simulation.input[variable.name] = value
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            simulation.compute()
        theirs.append(simulation.output["tip"])
    np.testing.assert_allclose(ours[:, 0], theirs, rtol=0, atol=25e-12)
    assert np.ptp(theirs) > 5.0


TOLERANCE = 5e-5
TOLERANCE_BETWEEN_POINTS = 1e-3

OCTAVES_OWN = "/usr/share/octave/packages/fuzzy-logic-toolkit-0.4.6/mamdani_tip_calculator.fis"


def systems() -> dict[str, FuzzySystem]:
    found = {
        "paper": force_x_system(),
        "climate": flat_system(),
        "product": flat_system("product", "probabilistic_sum"),
        "denied": denied_system(),
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
def test_octave_evaluates_our_files_as_we_do(tmp_path):
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
        for name in ("paper", "climate", "product", "denied", "nested", "tipper", "dimmer")
        for form in (fis, fll)
        # the dimmer's rules combine in two ways, which a .fis file cannot say
        if (name, form) not in {("dimmer", fis), ("nested", fis)}
    ],
)
def test_fuzzylite_evaluates_our_files_as_we_do(tmp_path, name, form):
    system = systems()[name]
    inputs = spread_inputs(system, 300)
    path = tmp_path / f"{name}.{form.__name__.rpartition('.')[2]}"
    path.write_text(form.write(alone(system)).text, encoding="utf-8")
    assert_near(system, compile(system)(inputs), fuzzylite_outputs(path, inputs, tmp_path))


@pytest.mark.slow
def test_fuzzylite_implies_and_aggregates_as_we_do(tmp_path):
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


def test_fuzzylite_evaluates_the_dimmer_as_it_is(tmp_path):
    system = systems()["dimmer"]
    inputs = spread_inputs(system, 300)
    assert_near(system, compile(system)(inputs), fuzzylite_outputs(EXAMPLES / "dimmer.fll", inputs, tmp_path))
