"""The player on the review page of a run: it opens cases, and the page has one time."""

import numpy as np
import pytest

from pipeline.run import artifacts, tables
from tests.browser import LOOKS, serious_violations
from tests.pipeline.report.runs import run_of
from tests.policies import check_policy, check_references

pytestmark = pytest.mark.slow

READY = "() => globalThis.player?.sides?.[0].flight && player.row !== null"
SHOWN = """() => ({
    number: player.cases.numbers[player.row], k: player.lead.view.sample, heard: player.lead.view.heard,
    flights: [...document.querySelectorAll(".live.flight select:first-of-type")]
        .filter(each => each.options.length > 2).map(each => each.selectedOptions[0].text),
    times: [...document.querySelectorAll(".live.flight output")].map(each => each.value),
})"""
OPEN = "([number, time]) => player.open(player.cases.numbers.indexOf(number), time)"
UNFOLD = "() => document.querySelectorAll('details.part').forEach(each => { each.open = true; })"
NUM_CASES = 30
PERIOD_S, TIME_S = 10, 300


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("reviewed")
    words = (
        "+experiment=evaluate",
        "controller=champion_27",
        "sun=random",
        f"monte_carlo.num_cases={NUM_CASES}",
    )
    run_of(made, ("evaluate", "record", "report"), *words)
    return made


@pytest.fixture
def ready(opened, folder):
    """Open the page with all parts unfolded, and wait for its first flight."""

    def open_page(width=1400, **options):
        text = (folder / artifacts.REVIEW).read_text(encoding="utf-8")
        page = opened(text, width, reduced_motion="reduce", **options)
        page.wait_for_function(READY)
        page.evaluate(UNFOLD)
        return page

    return open_page


def test_any_case_opens_and_all_systems_follow_its_time(ready, folder):
    page = ready()
    spent = tables.read_parquet(folder, artifacts.EPISODES)["delta_v_m_s"]
    recorded = {int(path.stem.rpartition("-")[2]): path.stem for path in (folder / "episodes").glob("*.mcap")}
    others = [case for case in range(NUM_CASES) if case not in recorded]
    for case in (others[0], *recorded, others[1]):
        page.evaluate(OPEN, [case, TIME_S])
        page.wait_for_function("case_ => player.cases.numbers[player.row] === case_", arg=case)
        page.wait_for_function("k => player.lead.view.heard === k", arg=TIME_S / PERIOD_S)
        assert (
            page.evaluate("() => player.lead.flight.spent(player.lead.flight.numSamples - 1)") == spent[case]
        )
        shown = page.evaluate(SHOWN)
        assert set(shown["flights"]) == {recorded.get(case, "the flight that plays, every decision")}
        decided = [float(words.removesuffix(" s")) for words in shown["times"]]
        assert len(decided) == 3
        assert max(decided) <= TIME_S


def test_the_sliders_of_the_review_move_the_player(ready, folder):
    page = ready()
    names = sorted(path.stem for path in (folder / "episodes").glob("*.mcap"))
    select = page.locator(".live.flight select").first
    for name in names:
        select.select_option(label=name)
        case = int(name.rpartition("-")[2])
        page.wait_for_function("case_ => player.cases.numbers[player.row] === case_", arg=case)
        slider = page.locator(".live.flight input[type=range]").first
        for column in ("2", "5"):
            slider.fill(column)
            time = page.evaluate("() => parseFloat(document.querySelector('.live.flight output').value)")
            page.wait_for_function("k => player.lead.view.heard === k", arg=round(time / PERIOD_S))
    sensed = page.evaluate("() => player.lead.sensed()[0]")
    inferred = page.evaluate("() => review.states[0].inputs")
    column = np.searchsorted(sensed["times"], time)
    assert inferred == pytest.approx(sensed["inputs"][column], rel=1e-6)


@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_fits_and_axe_finds_nothing(ready, axe, width, scheme):
    page = ready(width, color_scheme=scheme)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    drawn = page.evaluate(
        """() => [...document.querySelectorAll("#player rect.bar")].map(bar =>
            [bar.getBBox().height, Number(bar.getAttribute("height"))])"""
    )
    assert all(
        shown == pytest.approx(wanted, rel=1e-3) for shown, wanted in drawn
    )  # the styles of both agree
    assert serious_violations(page, axe) == []


def test_the_page_runs_nothing_but_its_scripts(folder):
    text = (folder / artifacts.REVIEW).read_text(encoding="utf-8")
    check_policy(text)
    check_references(text)
