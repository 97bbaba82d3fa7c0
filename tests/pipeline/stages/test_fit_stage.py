"""A controller fitted to a mission, in miniature."""

import re
import shlex
from dataclasses import replace
from html import unescape

import pytest

from fis_tools.formats import serialize
from fis_tools.model import Triangular
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.runs import MISSED
from pipeline.evaluation import fitting
from pipeline.evaluation.fitting import FlightTally, Variant
from pipeline.evaluation.statistics import Fraction
from pipeline.flight.control.controller import ControllerError
from pipeline.report.fit import BY_RULES, render_fit
from pipeline.run import artifacts, configuration
from pipeline.run.runner import Missed, Unimproved
from pipeline.settings.checks import SettingError
from pipeline.settings.places import conf_folder
from pipeline.stages import fit
from tests.browser import assert_tables_fit

SHIPPED = conf_folder() / "controller" / "champion_27.yaml"
#: a chief of 2 m, seen in half an hour
MISSION = ("chief.inspection_radius_m=2", "deputy.min_distance_m=5", "deputy.max_distance_m=60")
SMALL = ("fit.bases=[champion_27]", "fit.draws=3", "fit.cases=[3,4]", "fit.kept=[2]", "fit.num_cases=5")
SMALL += ("duration_s=1800", "attitude=ideal", "optimizer.population_size=5", "optimizer.generations=1")
SMALL += (
    "fit.neighbours=2",
    "fit.planners=[champion_81]",
    "starts.num_cases=4",
    "optimizer.validation_cases=4",
    "optimizer.workers=1",
)


def composed(*overrides: str):
    return compose_experiment(["+experiment=fit_mission", *MISSION, *SMALL, *overrides])


def fitted(folder, *overrides: str, resume: bool = False):
    run = composed(*overrides)
    configuration.write(folder, run.config)
    return fit.run(replace(run.experiment, resume=resume), folder)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fitted")
    return fitted(folder, "fit.workers=1"), folder


def test_a_fit_hands_back_a_controller_that_flies_and_says_how(done):
    said, folder = done
    summary = artifacts.read_json(folder, artifacts.FIT)
    # five flights show no success of 95 %
    assert isinstance(said, Missed)
    assert said.startswith(
        f"goal missed: the best, {summary['last']['words']}, is not shown to succeed in 95 %"
    )
    assert f"{summary['last']['success']['count'] * 20:.1f} % of 5 flights succeed" in said
    for limit in summary["limits"]:
        assert limit["kept"] == (limit["sentence"] not in said)
    champion = serialize.load(folder / artifacts.CHAMPION)
    readable = serialize.load(folder / artifacts.FIT_CONTROLLER)
    assert (champion.systems, dict(champion.attributes).keys()) == (
        readable.systems,
        dict(readable.attributes).keys(),
    )
    assert [system.rules for system in champion.systems] == [
        system.rules for system in serialize.load(SHIPPED).systems
    ]
    for tally in filter(None, (summary[name] for name in ("fitted", "layered", "planned", "tuned", "last"))):
        assert sum(tally[end]["count"] for end in ("success", "exits", "misses")) == tally["num_cases"]
        assert tally["num_cases"] == 5 or (tally == summary["planned"] and tally["num_cases"] == 2)
    page = (folder / artifacts.FIT_PAGE).read_text(encoding="utf-8")
    for limit in summary["limits"]:
        assert limit["formula"] in page
    assert len(summary["limits"]) == 5
    assert summary["flyable"]["fraction"] == summary["limits"][-1]["value"]
    # the goal is missed by so few flights, and so others compete, as if they planned
    assert summary["planned"]["words"].startswith("champion_81")
    assert f"planning: {summary['planned']['words']}" in page


def test_controllers_that_plan_are_scaled_by_the_chief_and_by_how_short_a_flight_is():
    experiment = composed("fit.planners=[champion_27_rehearsed]", "duration_s=1200").experiment
    planners = fitting.load_named("fit.planners", experiment.fit.planners)
    shipped, *scaled = fitting.planning_variants(experiment, planners)
    assert shipped == Variant("champion_27_rehearsed", is_shipped=True)
    assert [(each.size, each.tempo, each.decides_always) for each in scaled] == [
        (0.2, tempo, clock) for tempo in (1.0, 5.1) for clock in (False, True)
    ]
    numbers = dict(scaled[-1].controller(planners["champion_27_rehearsed"], experiment.mission).attributes)
    assert (numbers["foresight_reach_m_s"], numbers["rehearsal_point_m_s"]) == ("0.306", "0.153")
    # where pushes are larger, points cost more than at home
    assert numbers["foresight_points"] == numbers["coast_below_points"]
    calm = dict(scaled[0].controller(planners["champion_27_rehearsed"], experiment.mission).attributes)
    assert "foresight_points" not in calm
    # a third of a turn more than half of the points are lit: 0.5 + 0.0011068 1200/(2 pi) of them
    assert float(numbers["foresight_coast_points"]) == pytest.approx(4.5 * 0.7114, rel=2e-3)


def test_where_pushes_were_chosen_ahead_the_page_tells_the_share_that_rules_fired(done):
    summary = artifacts.read_json(done[1], artifacts.FIT)
    planned = summary["planned"] | {"ahead_percent": 75.0}
    pages = [render_fit("mine", summary | more) for more in ({}, {"planned": planned})]
    assert [BY_RULES in page for page in pages] == [False, True]
    flown = pages[1].partition("How they fly")[2].partition("</table>")[0]
    rows = re.findall(r"<tr>.*?</tr>", flown, re.DOTALL)[1:]
    assert [">25.0<" in row for row in rows] == [f"planning: {planned['words']}" in row for row in rows]


def test_the_page_says_whether_the_goal_is_reached_and_how_to_fly(done):
    summary = artifacts.read_json(done[1], artifacts.FIT) | {"goal_percent": 99.9}
    page = render_fit("mine", summary)
    assert "misses the goal of 99.9 %" in page
    code = unescape(re.search(r"<pre[^>]*><code>(.*?)</code>", page, re.DOTALL)[1])
    assert shlex.split(code) == ["python", "-m", "pipeline", "fly", "RUN"]
    assert "Where RUN is the folder of this run" in page


def test_a_tuned_controller_that_flies_worse_is_not_handed_back(tmp_path, monkeypatch):
    def tuned(experiment, folder, start):
        """The same, but coasting from the start."""
        attributes = {**dict(start.controller.attributes), "coast_below_points": 100.0}
        return replace(start.controller, attributes=tuple(attributes.items()))

    monkeypatch.setattr(fit, "_is_tuned", lambda *_: True)
    monkeypatch.setattr(fit, "_tuned", tuned)
    fitted(tmp_path, "fit.workers=1", "fit.planners=[]")
    summary = artifacts.read_json(tmp_path, artifacts.FIT)
    assert summary["tuned"]["success"]["count"] < summary["last"]["success"]["count"]
    assert summary["last"] == summary["fitted"]


@pytest.mark.slow
def test_the_page_of_a_fit_fits_any_screen(done, opened):
    page = opened((done[1] / artifacts.FIT_PAGE).read_text(encoding="utf-8"))
    assert page.locator("table").count() >= 2
    assert_tables_fit(page)


def test_threads_and_interruptions_change_nothing(done, tmp_path):
    _, folder = done
    names = artifacts.FIT_CANDIDATES, artifacts.FIT_CONTROLLER
    expected = [(folder / name).read_bytes() for name in names]
    lines = expected[0].decode().splitlines(keepends=True)
    path = tmp_path / artifacts.FIT_CANDIDATES
    path.parent.mkdir()
    path.write_text("".join(lines[: len(lines) // 2]), encoding="utf-8")
    fitted(tmp_path, "fit.workers=2", resume=True)
    systems = [serialize.load(part / artifacts.CHAMPION).systems for part in (folder, tmp_path)]
    assert systems[0] == systems[1]
    assert path.read_bytes() == expected[0]


def test_a_table_that_cannot_be_read_is_explained(tmp_path):
    path = tmp_path / artifacts.FIT_CANDIDATES
    path.parent.mkdir()
    path.write_text("rung,base\n0,champion_27\n", encoding="utf-8")
    with pytest.raises(artifacts.ArtifactError, match=r"candidates.csv cannot be read .* delete it"):
        fitted(tmp_path, resume=True)


def test_a_champion_that_nothing_betters_is_handed_back(tmp_path, monkeypatch):
    monkeypatch.setattr(fitting, "sizes_worth_trying", lambda mission: (30.0, 40.0))
    words = fitted(
        tmp_path,
        *("chief.inspection_radius_m=10", "deputy.min_distance_m=15", "deputy.max_distance_m=200"),
        *("duration_s=3600", "fit.tunes=never", "fit.neighbours=0", "fit.planners=[]", "fit.goal_percent=0"),
    )
    assert isinstance(words, Unimproved)
    assert words.startswith("not improved: champion_27 as shipped is handed back")
    assert not artifacts.read_json(tmp_path, artifacts.FIT)["improved"]
    assert serialize.load(tmp_path / artifacts.CHAMPION) == serialize.load(SHIPPED)


def tally(success: float, exits: float = 0.0, seen: float = 1.0, delta_v: float = 0.4) -> FlightTally:
    shares = success, exits, 1.0 - success - exits
    ends = (Fraction(round(100 * share), share, share, share) for share in shares)
    return FlightTally(100, *ends, seen, delta_v)


def at_work(last: FlightTally | None):
    """A fit in which nothing competes, and whose last result flies like a tally."""
    fitting_now = object.__new__(fit._Fit)
    fitting_now._experiment, fitting_now._drawn, fitting_now._near = composed().experiment, [], []
    fitting_now._bases, fitting_now._last = {"base": None}, last and flying_like(last)
    return fitting_now


def flying_like(flown: FlightTally) -> fit.FitResult:
    return fit.FitResult("", None, None, flown, is_shipped=False)


@pytest.mark.parametrize(
    ("last", "rules", "is_settled"),
    [(None, 0.5, False), (1.0, 1.0, True), (0.6, 0.5, True), (0.5, 0.5, False), (0.5, 0.6, False)],
)
def test_a_fit_is_settled_at_the_goal_or_clearly_above_rules(last, rules, is_settled):
    assert at_work(last and tally(last))._is_settled(tally(rules)) == is_settled


@pytest.mark.parametrize(
    ("last", "layered", "kept"), [(None, 0.2, 0.2), (0.5, 0.6, 0.6), (0.5, 0.5, 0.5), (0.6, 0.5, 0.6)]
)
def test_the_layer_is_kept_where_more_flights_succeed_with_it(monkeypatch, last, layered, kept):
    with_layer, state = flying_like(tally(layered)), at_work(last and tally(last))
    before = state._last
    monkeypatch.setattr(fit, "_best_with_layer", lambda *_: Variant("base", 1.0, 1.0))
    monkeypatch.setattr(fit._Fit, "_stand", lambda *_: with_layer)
    state._try_layer(tally(0.1, exits=0.9))
    assert state._last.tally.success.fraction == kept
    assert state._last is (with_layer if before is None or layered > last else before)


def test_the_layer_is_tried_where_most_that_fail_leave_the_limits(monkeypatch):
    tried = []
    monkeypatch.setattr(fit, "_best_with_layer", lambda *_: Variant("base", 1.0, 1.0))
    monkeypatch.setattr(fit._Fit, "_stand", lambda *_: tried.append(True) or flying_like(tally(0.5)))
    for exits, is_tried in ((0.0, False), (0.45, False), (0.5, True)):
        tried.clear()
        at_work(None)._try_layer(tally(0.1, exits=exits))
        assert bool(tried) == is_tried


def test_where_rules_clearly_miss_the_goal_plans_come_first(tmp_path, monkeypatch):
    flown = []

    def tally_of(mission, controller, scenarios, *_):
        flown.append((controller.name.removesuffix("_fit_mission"), len(scenarios)))
        ends = [1.0, 0.0, 0.0] if controller.name.startswith("champion_81") else [0.0, 0.0, 1.0]
        count = len(scenarios)
        wide = [Fraction(round(count * end), end, 0.98 * end, 0.02 + 0.98 * end) for end in ends]
        return FlightTally(count, *wide, 0.5, 0.4)

    monkeypatch.setattr(fit, "tally_of", tally_of)
    assert not isinstance(fitted(tmp_path, "fit.num_cases=20"), Missed)
    summary = artifacts.read_json(tmp_path, artifacts.FIT)
    assert summary["last"] == summary["planned"]
    assert summary["fitted"] is summary["tuned"] is None
    rules = [count for name, count in flown if name == "champion_27"]
    assert set(rules) == {3}
    # of the starts that judge it those that settle the question
    assert flown[-1] == ("champion_81", 8)


@pytest.mark.slow
def test_a_goal_that_is_missed_has_an_exit_code_and_a_last_line(tmp_path, ran):
    words = ["+experiment=fit_mission", *MISSION, *SMALL, "duration_s=300", "fit.tunes=never"]
    words += ["fit.goal_percent=50"]
    errors = ran(*words, f"hydra.run.dir={tmp_path}", code=MISSED).err
    last = errors.strip().splitlines()[-1]
    summary = artifacts.read_json(tmp_path, artifacts.FIT)
    success, number = summary["last"]["success"], summary["last"]["num_cases"]
    assert success["low"] < 0.5
    assert last.startswith("goal missed: ")
    percent, low = 100.0 * success["count"] / number, 100.0 * success["low"]
    assert f"{percent:.1f} % of {number} flights succeed ({low:.1f} to " in last
    reasons = [limit["sentence"] for limit in summary["limits"] if not limit["kept"]]
    assert any("radians of the orbit that a flight lasts" in reason for reason in reasons)
    assert last.endswith("; ".join(f"limited by the {reason}" for reason in reasons))
    assert serialize.load(tmp_path / artifacts.CHAMPION).name == summary["controller"]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("fit.kept=[2,1]", "the second must have one less than the first"),
        ("fit.bases=[]", "name at least one, and each once"),
        ("problem=docking", "the champions that are scaled inspect"),
    ],
)
def test_impossible_settings_are_refused(override, words):
    with pytest.raises(SettingError, match=words):
        composed(override)


def test_bases_without_rules_are_refused(tmp_path):
    with pytest.raises(ControllerError, match=r"fit\.bases has coast, which has no rules"):
        fitted(tmp_path, "fit.bases=[coast]")


def test_the_shapes_of_a_fitted_controller_stay_readable(done):
    champion = serialize.load(done[1] / artifacts.CHAMPION)
    for system in champion.systems:
        for variable in (*system.inputs, *system.outputs):
            assert float(f"{variable.maximum:.3g}") == variable.maximum
            assert all(isinstance(term.membership, Triangular) for term in variable.terms)
