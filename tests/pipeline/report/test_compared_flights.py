"""Flights of a comparison and flights to a goal on the page of a report: they open, or it says why not."""

import numpy as np
import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.report.page import _left_out
from pipeline.report.played import shown_of
from pipeline.run import artifacts, tables
from tests.browser import LOOKS, serious_violations
from tests.pipeline.report.runs import run_of

READY = "() => globalThis.player?.sides?.some(side => side.flight)"
#: of the runs that are shown, the fuel of a case
SPENT = """async number => {
    const row = player.cases.numbers.indexOf(number);
    await player.open(row);
    return player.sides.map(({ run, flight }) => [run.name, flight?.spent(flight.numSamples - 1)]);
}"""
#: of a case, what each run spends until it ends, and when that is
ENDED = """async number => {
    await player.open(player.cases.numbers.indexOf(number));
    return player.sides.map(({ run, flight }) =>
        [run.name, flight.spent(flight.numSamples - 1), (flight.numSamples - 1) * flight.periodS]);
}"""
#: of what is painted, how many lengths of the picture the farthest end of a line lies outside
OUTSIDE = """() => {
    const { view } = player.lead, { pen } = view, [width, height] = view.size, ends = [];
    pen.lineTo = (x, y) => { ends.push(Math.abs(x) / width, Math.abs(y) / height); };
    view.paint();
    delete pen.lineTo;
    return Math.max(...ends);
}"""
#: of all pushes of the first run's flight, those whose reason is not the strongest one's
MISNAMED = """() => {
    const { flight } = player.sides[0], steps = Array.from({ length: flight.numSamples - 1 }, (_, k) => k);
    const pushes = steps.filter(k => k % flight.stride === 0 && flight.force(k).some(Boolean));
    const named = k => flight.reasons(k).map(({ detail }) => detail).find(Boolean);
    return [pushes.length, pushes.filter(k => named(k) !== flight.why(k))];
}"""
CONTROLLERS = "compare.controllers=[champion_27,lqr]"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("compared")
    run_of(made, ("compare", "report"), "+experiment=baselines", CONTROLLERS, "sun=random")
    return made


def page_in(folder):
    return (folder / artifacts.REPORT).read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_case_of_a_comparison_flies_by_each_controller_and_layer(opened, folder):
    page = opened(page_in(folder), 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert "The flights are those under the Sun random." in page.locator("#comparison").inner_text()
    flights = tables.read_parquet(folder, artifacts.COMPARISON_EPISODES)
    for box in page.locator(".chosen input").all():
        box.check()
    for case in (0, 7):
        shown = dict(page.evaluate(SPENT, case))
        for controller in ("champion_27", "lqr"):
            for layer, words in (("none", ""), ("filter", ", safety layer")):
                (row,) = np.flatnonzero(
                    (flights["controller"] == controller)
                    & (flights["safety"] == layer)
                    & (flights["sun"] == "random")
                    & (flights["case"] == case)
                )
                assert shown.pop(f"{controller}{words}") == flights["delta_v_m_s"][row]
        assert not shown
    # what flies a case is typed for the mission as it is, without another layer
    commands = dict(page.evaluate("() => player.sides.map(({ run }) => [run.name, run.command])"))
    for name in ("champion_27", "lqr"):
        assert f"controller={name}" in commands[name]
        assert not commands[f"{name}, safety layer"]


@pytest.mark.slow
@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_of_a_comparison_fits_and_axe_finds_nothing(opened, axe, folder, width, scheme):
    page = opened(page_in(folder), width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_comparison_whose_flights_are_gone_says_so(folder, tmp_path):
    words = ("+experiment=baselines", CONTROLLERS, "sun=random")
    for name in (artifacts.COMPARISON, artifacts.COMPARISON_TABLE):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    run_of(tmp_path, ("report",), *words)
    assert "No flight opens here: the comparison&#39;s flights were not kept." in page_in(tmp_path)
    tables.write_parquet(
        tmp_path / artifacts.COMPARISON_EPISODES,
        {name: values[:3] for name, values in _columns(folder).items()},
    )
    run_of(tmp_path, ("report",), *words)
    assert "No flight opens here: the comparison&#39;s flights are not those of its" in page_in(tmp_path)


def _columns(folder):
    flights = tables.read_parquet(folder, artifacts.COMPARISON_EPISODES)
    return {name: flights[name] for name in flights}


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_flights_to_a_goal_fly_up_to_where_they_end(opened, axe, tmp_path, scheme):
    words = ("+experiment=compare_docking", "compare.controllers=[champion_docking,coast]")
    experiment = run_of(tmp_path, ("compare", "report"), *words, "problem.goal_radius_m=90")
    page = opened(page_in(tmp_path), 1400, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    flights = _columns(tmp_path)
    ends = set()
    for number in page.evaluate("() => [...player.cases.numbers].slice(0, 8)"):
        for name, spent, end_s in page.evaluate(ENDED, number):
            row = np.flatnonzero((flights["controller"] == name) & (flights["case"] == number))[0]
            assert spent == pytest.approx(flights["delta_v_m_s"][row], rel=1e-6)  # of tracks, in 32 bits
            assert end_s == flights["end_s"][row]
            ends.add(end_s)
        # free motion leads kilometres away
        assert page.evaluate(OUTSIDE) < 3
        num_pushes, misnamed = page.evaluate(MISNAMED)
        assert num_pushes > 100
        assert misnamed == []
    assert min(ends) < max(ends) == experiment.mission.duration_s
    assert not page.locator("#player .key").first.is_visible()  # there are no points
    assert serious_violations(page, axe) == []


@pytest.mark.parametrize(
    ("controllers", "layers", "shown", "words"),
    [
        (["lqr", "coast"], "none,filter", 4, ""),
        (
            [f"champion_{name}" for name in ("27", "81", "any_sun")] + ["lqr", "coast"],
            "none,filter",
            5,
            "5 of 5",
        ),
        ([*(f"coast{number}.yaml" for number in range(9))], "filter", 8, "8 of 9"),
    ],
)
def test_a_page_says_whose_flights_it_has_no_room_for(controllers, layers, shown, words):
    listed = f"compare.controllers=[{','.join(controllers)}]", f"compare.safety=[{layers}]"
    compare = compose_experiment(["+experiment=baselines", *listed]).experiment
    assert len(shown_of(compare)) == shown
    layer = layers.partition(",")[0]
    room = f" The page has room for {words} controllers with safety={layer}." if words else ""
    assert _left_out(compare) == room
