"""Wired systems: MATLAB's value, scikit-fuzzy composed by hand, bounds, explanations, files, refusals."""

import json
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from fis_tools.analysis.arrays import surface
from fis_tools.analysis.bounds import ask, output_ranges
from fis_tools.engines import bounded_trees
from fis_tools.engines.compiler import compile
from fis_tools.engines.tree_inference import infer_tree
from fis_tools.errors import ControllerFileError, Mistake
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain
from fis_tools.findings.simplification import simplify
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.files import written
from fis_tools.model import (
    And,
    Consequent,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Is,
    Rule,
    Triangular,
    Variable,
    Wire,
    tree,
    with_semantics,
)
from fis_tools.model.validate import InvalidSystem
from fis_tools.review import page
from fis_tools.words.text import wires_in_words
from pipeline.flight.control.controller import ControllerError, from_fuzzy
from tests.fis_tools.control_systems import build_simulation
from tests.fis_tools.sample_controllers import table_system, terms
from tests.policies import check_policy

THIRDS = terms(low=Gaussian(0.0, 0.3), middle=Gaussian(0.5, 0.2), high=Gaussian(1.0, 0.3))


def unit(name: str, **changes: object) -> Variable:
    return Variable(name, "", 0.0, 1.0, THIRDS, num_points=51, **changes)  # type: ignore[arg-type]


def part(name: str, inputs: tuple[str, ...], output: str, shift: int) -> FuzzySystem:
    words = [("low", "middle", "high")[(sum(cell) + shift) % 3] for cell in product(range(3), repeat=2)]
    sides = tuple(unit(each) for each in inputs)
    return table_system(name, sides, unit(output, default=0.5), words)


def wired(semantics: str = "scikit-fuzzy") -> FuzzyController:
    """Two systems that share an input feed a third one, listed before them."""
    parts = (part("last", ("p", "q"), "y", 0), part("a", ("u", "v"), "p", 1), part("b", ("v", "w"), "q", 2))
    systems = tuple(with_semantics(each, semantics) for each in parts)  # type: ignore[arg-type]
    return FuzzyController(
        "wired", systems, wires=(Wire("a/p", "last/p"), Wire("b/q", "last/q"), Wire("a/v", "b/v"))
    )


WIRED = wired()
ROWS = np.random.default_rng(5).uniform(-0.1, 1.1, (12, 3))


def test_the_value_is_that_of_matlab() -> None:
    """Two default systems in MATLAB's documentation of evalfis; 50 points, inputs 0.5, 0.2, 0.7."""
    centres = {
        f"mf{n}": Triangular(c - 5 / 12, c, c + 5 / 12) for n, c in enumerate((0.0, 0.5, 1.0), start=1)
    }
    first, second, out = (
        Variable(name, "", 0.0, 1.0, terms(**centres), num_points=50, default=default)
        for name, default in (("input1", None), ("input2", None), ("output1", 0.5))
    )
    pairs = product(centres, repeat=2)
    rules = tuple(
        Rule(And((Is("input1", left), Is("input2", right))), (Consequent("output1", "mf1"),))
        for left, right in pairs
    )
    parts = tuple(
        FuzzySystem(name, (first, second), (out,), rules, semantics="matlab") for name in ("fis1", "fis2")
    )
    compiled = compile(FuzzyController("tree", parts, wires=(Wire("fis1/output1", "fis2/input1"),)))
    assert [variable.name for variable in compiled.system.inputs] == ["input1", "fis1/input2", "fis2/input2"]
    assert f"{compiled(np.array([[0.5, 0.2, 0.7]]))[0, 0]:.4f}" == "0.1553"


def test_answers_are_those_of_scikit_fuzzy_composed_by_hand() -> None:
    simulations = {system.name: build_simulation(system) for system in WIRED.systems}

    def computed(name: str, **inputs: float) -> float:
        for variable, value in inputs.items():
            simulations[name].input[variable] = np.clip(value, 0.0, 1.0)
        simulations[name].compute()
        return next(iter(simulations[name].output.values()))

    expected = [
        computed("last", p=computed("a", u=u, v=v), q=computed("b", v=v, w=w)) for u, v, w in ROWS.tolist()
    ]
    compiled = compile(WIRED)
    np.testing.assert_allclose(compiled(ROWS)[:, 0], expected, atol=1e-12)
    by_name = compiled({"w": ROWS[:, 2], "u": ROWS[:, 0], "v": ROWS[:, 1]})
    np.testing.assert_array_equal(by_name["y"], compiled(ROWS)[:, 0])
    steps = [infer_tree(tree(WIRED), row).outputs[0].value for row in ROWS]
    np.testing.assert_allclose(steps, expected, atol=1e-12)


@pytest.mark.parametrize("semantics", ["scikit-fuzzy", "matlab"])
def test_bounds_hold(semantics: str) -> None:
    rng, controller = np.random.default_rng(6), wired(semantics)
    program = bounded_trees.pack(tree(controller))
    low = rng.uniform(0.0, 1.0, (40, 3))
    high = low + rng.uniform(0.0, 0.5, low.shape) * rng.choice([1.0, 1e-3], (40, 1))
    least, greatest, _ = bounded_trees.bound(program, low, high)
    compiled = compile(controller)
    for share in rng.uniform(0.0, 1.0, (40, 1, 3)):
        outputs = compiled(low + share * (high - low))
        assert np.all((least - 1e-12 <= outputs) & (outputs <= greatest + 1e-12))
    narrow = (high - low).max(axis=1) < 1e-3
    assert (greatest - least)[narrow].max() < 0.01, "small boxes are bounded closely"
    region = "u in [0.2, 0.4], v in [0.3, 0.5], w > 0.8"
    (limits,) = output_ranges(tree(controller), region)
    inside = rng.uniform([0.2, 0.3, 0.8], [0.4, 0.5, 1.0], (500, 3))
    values = compiled(inside)[:, 0]
    assert limits.outer.low <= values.min() <= values.max() <= limits.outer.high
    assert limits.outer.high - limits.outer.low < 1.05 * (limits.inner.high - limits.inner.low)
    assert ask(tree(controller), f"y > {limits.outer.high + 1e-3}", region).verdict == "no"
    assert ask(tree(controller), f"y > {values.mean()}", region).verdict == "yes"


def test_what_a_rule_is_needed_for_is_told_through_the_wires() -> None:
    inputs = {"u": 0.3, "v": 0.6, "w": 0.1}
    explained, given = explain(tree(WIRED), inputs), np.array([[0.3, 0.6, 0.1]])
    whole = compile(WIRED)(given)[0, 0]
    assert {explained.system.systems[move.system].name for move in explained.moves} == {"a", "b", "last"}
    for move in explained.moves[:6]:
        changed = explained.system.systems[move.system]
        rules = changed.rules[: move.rule - 1] + changed.rules[move.rule :]
        systems = tuple(replace(s, rules=rules) if s.name == changed.name else s for s in WIRED.systems)
        without = compile(replace(WIRED, systems=systems))(given)[0, 0]
        np.testing.assert_allclose(move.needed, whole - without, atol=1e-9)
    flip = next(flip for flip in explain(tree(WIRED), inputs, 0.5).outputs[0].flips if flip.first is not None)
    before, after = (
        compile(WIRED)(given + (value - given) * (np.array(["u", "v", "w"]) == flip.input.name))[0, 0]
        for value in (flip.last, flip.first)
    )
    assert (before - 0.5) * (after - 0.5) <= 0.0
    assert "last/p = " in explained.text()
    assert json.loads(json.dumps(explained.plain(), allow_nan=False))["wires"][0]["from"] == "a/p"


def test_a_value_that_is_no_number_ends_the_chain() -> None:
    """A condition of fuzzylite's that never holds leaves an output without a value."""
    sides = terms(low=Triangular(0.0, 0.1, 0.2), high=Triangular(0.8, 0.9, 1.0))
    source_variable = Variable("x", "", 0.0, 1.0, sides, num_points=21)
    first = table_system("first", (source_variable,), unit("y"), ["low", "high"], semantics="fuzzylite")
    second = table_system("second", (unit("y"),), unit("z"), ["low"] * 3, semantics="fuzzylite")
    controller = FuzzyController("gapped", (first, second), wires=(Wire("first/y", "second/y"),))
    answers = compile(controller)(np.array([[0.1], [0.5], [0.9]]))[:, 0]
    np.testing.assert_array_equal(np.isnan(answers), [False, True, False])
    least, greatest, _ = bounded_trees.bound(
        bounded_trees.pack(tree(controller)), np.array([[0.4]]), np.array([[0.6]])
    )
    assert np.isnan([least, greatest]).all()
    with pytest.raises(
        ValueError, match="first/y is no number there, and second needs it; give it a default"
    ):
        explain(tree(controller), {"x": 0.5})


@pytest.mark.parametrize(
    ("wires", "words"),
    [
        (
            [("a/p", "last/p"), ("last/y", "a/u")],
            "make a loop, so that none of last, a can be computed first",
        ),
        ([("a/u", "a/v"), ("a/v", "a/u")], "the inputs a/v, a/u share one another's value"),
        ([("a/pp", "last/p")], "there is no 'a/pp'; did you mean 'a/p'?"),
        ([("a/p", "last/y")], "ends at the output last/y; end it at an input"),
        ([("a/p", "last/p"), ("b/q", "last/p")], "2 wires end at last/p; drop all but one"),
    ],
)
def test_what_cannot_be_wired_is_refused_in_a_sentence(wires, words: str) -> None:
    with pytest.raises(InvalidSystem, match=words):
        compile(replace(WIRED, wires=tuple(Wire(*ends) for ends in wires)))


def test_what_does_not_fit_is_refused_in_a_sentence() -> None:
    last, *others = WIRED.systems
    inputs = (replace(last.inputs[0], unit="m"), last.inputs[1])
    kilometres = replace(others[0], outputs=(replace(others[0].outputs[0], unit="km"),))
    with pytest.raises(InvalidSystem, match="a/p is in km and last/p in m; give both the same unit"):
        compile(replace(WIRED, systems=(replace(last, inputs=inputs), kilometres, others[1])))
    mixed = (last, with_semantics(others[0], "matlab"), others[1])
    with pytest.raises(
        InvalidSystem, match="mean what matlab and scikit-fuzzy do; give all of them the same"
    ):
        compile(replace(WIRED, systems=mixed))
    for what in (simplify, source.write):
        with pytest.raises(Mistake, match="are wired; take one with --system"):
            what(WIRED)
    with pytest.raises(ControllerError, match="has wires between its systems, which flights do not have"):
        from_fuzzy(replace(WIRED, attributes=(("force_axes", "hill"),)))


def test_files_keep_wires(tmp_path) -> None:
    for kind, dump in (("yaml", serialize.dump_yaml), ("json", serialize.dump_json)):
        assert serialize.loads(dump(WIRED), kind) == WIRED
    assert serialize.content_hash(WIRED) != serialize.content_hash(replace(WIRED, wires=WIRED.wires[:2]))
    assert not WIRED.acts_like(replace(WIRED, wires=()))
    assert "wires" in {fact.what for fact in difference(WIRED, replace(WIRED, wires=())).facts}
    with pytest.raises(ControllerFileError, match="wires\\[0\\]: unknown key 'form'"):
        serialize.loads(serialize.dump_yaml(WIRED).replace("{from: ", "{form: "), "yaml")
    lost = [loss for file in written(wired("matlab"), tmp_path / "w.fis").values() for loss in file.losses]
    assert "a/p last/p" in lost[-1]


def test_commands_take_wired_systems(tmp_path, run) -> None:
    files = [tmp_path / f"{system.name}.yaml" for system in WIRED.systems]
    for system, path in zip(WIRED.systems, files, strict=True):
        path.write_text(serialize.dump_yaml(replace(WIRED.only([system.name]), provenance=())))
    whole = tmp_path / "whole.yaml"
    ends = [word for wire in WIRED.wires for word in ("--wire", wire.source, wire.target)]
    run("import", *files, "--name", "wired", *ends, "-o", whole)
    assert serialize.load(whole) == WIRED
    assert "the whole takes u, v and w and gives y" in run("show", whole).out
    printed = run("surface", whole, "--points", "3", "--x", "u", "--y", "w").out.splitlines()[1:]
    values = surface(tree(WIRED), "u", "w", num_points=3).values
    assert [float(line.split(",")[2]) for line in printed] == values.ravel().tolist()
    region = ("--where", "u > 0.9, v > 0.9, w < 0.1")
    assert "no, proved" in run("bounds", whole, *region, "--ask", "y > 2").out
    assert "the inputs w of wired are not given" in run("explain", whole, "--inputs", "u=1,v=0", code=2).err
    plain = json.loads(run("explain", whole, "--inputs", "u=1,v=0,w=1", "--json").out)
    assert plain["explanations"][0]["system"] == "wired"


def test_a_review_page_says_what_feeds_what() -> None:
    written_page = page.write(WIRED)
    for words in wires_in_words(WIRED):
        assert words in written_page
    assert "Surfaces of the whole" in written_page
    check_policy(written_page)
