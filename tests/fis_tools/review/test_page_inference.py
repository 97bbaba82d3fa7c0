"""The page infers as Python does."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.analysis import arrays, contribution, shapley
from fis_tools.engines import compiler
from fis_tools.findings import explanation
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.review import content, page
from tests import night
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import random_systems as drawn
from tests.fis_tools.engines.random_systems import inputs_for
from tests.fis_tools.render.picture_systems import autopilot_system
from tests.fis_tools.sample_controllers import GENERAL, SHIPPED

pytestmark = pytest.mark.slow

NUM_SAMPLES = night.count(50, 200)
INFER = """([place, rows]) => rows.map((row) => {
  const told = review.infer(review.systems[place], row);
  return { values: told.outputs.map(({ value }) => String(value)), firing: [...told.firing] };
})"""


SHARES = """([place, rows]) => rows.map((row) => {
  const system = review.systems[place];
  const inference = review.infer(system, row);
  return system.outputs.map((_, output) => {
    const { values, error } = review.shares(system, output, inference, review.quadrature);
    return { values: [...values], error };
  });
})"""


def random_systems(seed: int, count: int) -> tuple[FuzzySystem, ...]:
    generator = np.random.default_rng(seed)
    makers = (drawn.random_general_system, drawn.random_general_system, drawn.full_table_system)
    systems = (makers[index % len(makers)](generator) for index in range(count))
    return tuple(
        replace(drawn.hedged(system, generator) if index % 2 else system, name=f"random {index}")
        for index, system in enumerate(systems)
    )


CHAMPION = serialize.load(SHIPPED["paper_champion"])
CONTROLLERS = {
    "champion": CHAMPION,
    "everything": GENERAL,
    "125 rules": FuzzyController("many", (autopilot_system(),)),
    "random": FuzzyController("random", random_systems(seed=8, count=night.count(6, 24))),
    "sampled": FuzzyController(
        "sampled",
        tuple(system for system in drawn.sampled_systems(9, night.count(8, 40)) if not system.weighed),
    ),
}


@pytest.fixture(scope="module", autouse=True)
def _worded_once():
    """A page's words about a system are found once: they are the same on all pages of it."""
    worded = {}

    def words(number, system, samples, measures, make=content.system_words):
        key = number, id(system)
        if key not in worded:
            # the system is kept, so that no other one gets its id
            worded[key] = system, make(number, system, samples, measures)
        return worded[key][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(content, "system_words", words)
        yield


def test_universes_have_every_bit_of_those_of_python(opened):
    carried = """() => review.systems.map(({ inputs, outputs }) =>
        [...inputs, ...outputs].map(({ universe }) => [...universe]))"""
    num_uneven = 0
    for name in ("champion", "everything", "sampled"):
        systems = CONTROLLERS[name].systems
        counted = opened(page.write(CONTROLLERS[name])).evaluate(carried)
        assert counted == [[variable.universe.tolist() for variable in each.variables] for each in systems]
        num_uneven += sum(variable.points is not None for each in systems for variable in each.variables)
    assert num_uneven


@pytest.mark.parametrize("name", CONTROLLERS)
def test_outputs_and_firing_are_those_of_python(opened, name):
    controller = CONTROLLERS[name]
    browser_page = opened(page.write(controller))
    generator = np.random.default_rng(25)
    num_values = []
    for index, system in enumerate(controller.systems):
        rows = inputs_for(system, generator, NUM_SAMPLES)
        if system.is_sampled:
            rows = drawn.inputs_beyond(system, generator, NUM_SAMPLES)
        answers = browser_page.evaluate(INFER, [index, rows.tolist()])
        values = np.array([[float(value) for value in sample["values"]] for sample in answers])
        expected, strengths = step_by_step.inferred(system, rows)
        step_by_step.assert_near(values, expected, system, 1e-9)
        firing = np.array([sample["firing"] for sample in answers])
        np.testing.assert_allclose(firing, strengths, rtol=0, atol=1e-12)
        num_values.append(np.unique(expected[~np.isnan(expected)]).size)
    assert np.median(num_values) > NUM_SAMPLES / 4
    # every picture can be drawn; a complaint of the page would fail the module
    browser_page.evaluate("dispatchEvent(new Event('beforeprint'))")


def test_contributions_are_those_of_python(opened):
    (system,) = GENERAL.systems
    browser_page = opened(page.write(GENERAL))
    rows = inputs_for(system, np.random.default_rng(3), 60)
    answers = browser_page.evaluate(
        """(rows) => rows.map((row) => review.systems[0].outputs.map((_, output) =>
          [...review.contributions(review.systems[0], output, review.infer(review.systems[0], row))]))""",
        rows.tolist(),
    )
    expected = contribution.contributions(compiler.compile(system), rows)
    assert np.count_nonzero(expected) > 60
    np.testing.assert_allclose(np.array(answers).transpose(0, 2, 1), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "most"),
    [
        *((name, shapley.MOST_COALITIONS) for name in ("everything", "champion", "random")),
        *((name, 1) for name in ("125 rules", "random")),
    ],
)
def test_shares_are_those_of_python(opened, monkeypatch, name, most):
    controller = CONTROLLERS[name]
    script = page._script

    def limited(systems):
        return script(systems).replace("MOST_COALITIONS = 4096", f"MOST_COALITIONS = {most}")

    monkeypatch.setattr(page, "_script", limited)
    browser_page = opened(page.write(controller))
    monkeypatch.setattr(shapley, "MOST_COALITIONS", most)
    generator = np.random.default_rng(3)
    count = 0
    for index, system in enumerate(controller.systems):
        rows = inputs_for(system, generator, 4)
        answers = browser_page.evaluate(SHARES, [index, rows.tolist()])
        expected = shapley.shares(compiler.compile(system), rows)
        values = np.array([[output["values"] for output in sample] for sample in answers]).transpose(0, 2, 1)
        step_by_step.assert_near(values, expected.values, system, 1e-9)
        errors = np.array([[output["error"] for output in sample] for sample in answers])
        step_by_step.assert_near(errors, expected.error, system, 1e-9)
        count += np.count_nonzero(expected.values)
    assert count > 5


def test_the_limits_of_the_page_are_those_of_python():
    script = page._script([])
    for name in ("MOST_COALITIONS", "NUM_ORDERS", "SEED"):
        assert f"const {name} = {getattr(shapley, name)};" in script
    assert f"const FIRED = {arrays.FIRED};" in script


def test_the_smallest_change_that_turns_the_sign_is_that_of_python(opened):
    browser_page = opened(page.write(CHAMPION))
    change = "([place, row]) => review.signChange(review.systems[place], row, 0)"
    generator = np.random.default_rng(4)
    num_found = 0
    for index, system in enumerate(CHAMPION.systems):
        for row in generator.uniform(*step_by_step.ends(system), (8, len(system.inputs))):
            answers = browser_page.evaluate(change, [index, row.tolist()])
            nearest = explanation.flips(system, row)[0]
            assert (answers is None) == (nearest.first is None)
            if answers is not None:
                num_found += 1
                assert system.inputs[answers["input"]] == nearest.input
                width = nearest.input.maximum - nearest.input.minimum
                assert answers["at"] == pytest.approx(nearest.first, abs=1e-8 * width)
                assert answers["by"] == pytest.approx(nearest.change, abs=1e-8 * width)
    assert num_found > 12
