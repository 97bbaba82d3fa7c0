"""The report of a fleet: its figures are those of its files, and its page opens cases with all deputies."""

import re
from html.parser import HTMLParser
from statistics import mean, stdev

import numpy as np
import pyarrow.parquet as pq
import pytest

from pipeline.report.contents import gather
from pipeline.report.played_fleets import WHY
from pipeline.run import artifacts
from telemetry.file.reader import read
from telemetry.file.topics import DEPUTY_STATE, MISSION
from tests.browser import LOOKS, serious_violations
from tests.pipeline.report.runs import run_of

pytestmark = pytest.mark.slow

STAGES = ("scenario", "evaluate", "record", "report")
WORDS = ("+experiment=evaluate_fleet", "controller=champion_27", "sun=random", "fleet.deputies=2")
#: of which some fleets see enough
WORDS += ("inspection_threshold_percent=90",)
READY = "() => globalThis.player?.sides?.every(side => side.flight)"
#: of a case that is opened, where each side's deputy and the others are at a sample
AT = """async ([row, k]) => {
    await player.open(row);
    player.lead.view.show(k);
    return player.sides.map(({ flight, view, letter }) => ({
        position: flight.position(k), spent: flight.spent(flight.numSamples - 1),
        first: [...flight.seenBy].filter(by => by === letter).length,
        seen: flight.numSeen(flight.numSamples - 1),
        others: view.fellows.map(({ letter, flight }) => [letter, flight.position(k)]),
    }));
}"""


class Cells(HTMLParser):
    """The rows of all tables, as words."""

    def __init__(self, text):
        super().__init__()
        self.rows, self._is_in = [], False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag == "tr":
            self.rows.append([])
        elif tag in ("th", "td"):
            self.rows[-1].append("")
            self._is_in = True

    def handle_endtag(self, tag):
        if tag in ("th", "td"):
            self._is_in = False

    def handle_data(self, data):
        if self._is_in:
            self.rows[-1][-1] += data.replace("\N{NO-BREAK SPACE}", " ")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    return folder, run_of(folder, STAGES, *WORDS)


@pytest.fixture(scope="module")
def text(made):
    return (made[0] / artifacts.REPORT).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def episodes(made):
    return pq.read_table(made[0] / artifacts.EPISODES).to_pydict()


@pytest.fixture(scope="module")
def deputies(made):
    return pq.read_table(made[0] / artifacts.DEPUTIES).to_pylist()


def cell_of(rows, name):
    return next(row for row in rows if row and row[0] == name)


def test_figures_of_the_fleet_are_those_of_its_files(text, episodes, deputies):
    rows = Cells(text).rows
    spent = [row["delta_v_m_s"] for row in deputies]
    by_case = [spent[case : case + 2] for case in range(0, len(spent), 2)]
    for name, values, decimals in (
        ("Δv of all deputies (m/s)", [sum(each) for each in by_case], 3),
        ("Δv of the one that spends most (m/s)", [max(each) for each in by_case], 3),
        ("least distance between two (m)", episodes["nearest_pair_m"], 1),
    ):
        expected = [f"{number:.{decimals}f}" for number in (mean(values), stdev(values))]
        row = cell_of(rows, name)
        assert row[1].replace("\N{NO-BREAK SPACE}", " ") == " ± ".join(expected)
        assert row[3:] == [f"{number:.{decimals}f}" for number in (min(values), max(values))]
    for number in (1, 2):
        mine = [row for row in deputies if row["deputy"] == number]
        row = cell_of(rows, f"deputy {number}")
        for cell, name, decimals in (
            (1, "delta_v_m_s", 3),
            (2, "inspected_count", 1),
            (3, "mean_distance_m", 1),
        ):
            values = [each[name] for each in mine]
            shown = f"{mean(values):.{decimals}f} ± {stdev(values):.{decimals}f} ("
            assert row[cell].replace("\N{NO-BREAK SPACE}", " ").startswith(shown)
        nearest, farthest = (end([each[f"{end.__name__}_distance_m"] for each in mine]) for end in (min, max))
        assert row[4] == f"{nearest:.1f} to {farthest:.1f}"
        assert row[5] == f"{sum(each['violated'] for each in mine)} of {len(mine)}"


def test_the_time_is_that_of_fleets_that_see_enough(text, episodes):
    rows, times = Cells(text).rows, [time for time in episodes["enough_s"] if not np.isnan(time)]
    assert 1 < len(times) < len(episodes["enough_s"])
    shown = cell_of(rows, "time at which enough points are seen (s)")
    assert shown[1].replace("\N{NO-BREAK SPACE}", " ") == f"{mean(times):.0f} ± {stdev(times):.0f}"
    assert f"The time is that of the {len(times)} flights that see enough." in text


def test_what_is_of_one_deputy_is_left_out_by_name(text):
    words = " ".join(re.sub(r"<[^>]+>", " ", text).split())
    assert "A fleet of 2 deputies, each with the controller champion_27" in words
    assert "Plans of least fuel are of one deputy" in words
    assert "Not compared with plans of least fuel: the plans are of one deputy." in words
    assert "no table of paths is kept" in words
    assert "stage evaluate writes it" not in words
    assert not re.search(r"Paper, |paper 5\.62|\d paper|[Tt]he paper", words)


def test_pictures_show_each_deputy(made, text):
    folder, experiment = made
    (flight,) = gather(experiment, folder).shown
    for name in (f"trajectories-{flight.name}", *(f"control-{flight.name}-deputy-{row}" for row in (1, 2))):
        assert (folder / artifacts.FIGURES / f"{name}.png").exists()
        assert f'id="figure-{name}"' in text
    for part in flight.parts:
        start = ", ".join(f"{component:.2f}".replace("-", "−") for component in part.scenario.position_m)
        assert f"({start}) m" in text


def test_a_case_opens_with_all_deputies_as_they_flew(opened, made, text, deputies):
    folder, _ = made
    page = opened(text, 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    recorded = {path.stem: path for path in (folder / artifacts.RECORDINGS).glob("*.mcap")}
    # the median first
    assert f"median-case-{page.evaluate('player.cases.numbers[player.row]')}-deputy-1" in recorded
    rows = page.evaluate("() => [...player.cases.numbers.keys()].filter(row => player.sides[0].canOpen(row))")
    assert len(rows) > 2
    # the worst, the median and the best, as they are recorded
    assert {int(stem.split("-")[2]) for stem in recorded if "-case-" in stem} <= set(rows)
    compared = 0
    for row in rows:
        sides = page.evaluate(AT, [row, 40])
        mine = [each for each in deputies if each["case"] == row]
        for side, flown in zip(sides, mine, strict=True):
            assert side["spent"] == pytest.approx(flown["delta_v_m_s"], rel=1e-6)
            assert side["first"] == flown["inspected_count"]
            assert side["seen"] == sum(each["inspected_count"] for each in mine)
        first, second = sides
        assert first["others"] == [["B", second["position"]]]
        assert second["others"] == [["A", first["position"]]]
        for number, side in enumerate(sides, 1):
            ending = f"-case-{row}-deputy-{number}"
            for path in (path for stem, path in recorded.items() if stem.endswith(ending)):
                np.testing.assert_allclose(
                    side["position"], read(path)[DEPUTY_STATE]["position_m"][40], rtol=1e-6
                )
                compared += 1
    assert compared >= 4
    others = min(set(range(len(deputies) // 2)) - set(rows))
    page.evaluate("row => player.open(row)", others)
    said = page.locator("#player .said").inner_text()
    assert said.count(f"Case {others} is not part of this page: {WHY}.") == 1
    assert f"python -m pipeline fly RUN case={others}" in said


@pytest.mark.parametrize(("width", "scheme"), LOOKS)
def test_the_page_of_a_fleet_fits_and_axe_finds_nothing(opened, axe, text, width, scheme):
    page = opened(text, width, color_scheme=scheme, reduced_motion="reduce")
    page.wait_for_function(READY)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert page.locator("#player td").first.is_visible()
    assert serious_violations(page, axe) == []


def test_a_recording_in_the_review_opens_its_case_with_all_deputies(opened, made):
    folder, _ = made
    page = opened((folder / artifacts.REVIEW).read_text(encoding="utf-8"), 1400, reduced_motion="reduce")
    page.wait_for_function(READY)
    page.evaluate("() => document.querySelectorAll('details').forEach(fold => { fold.open = true; })")
    select = page.locator(".live.flight select").first
    for path in sorted((folder / artifacts.RECORDINGS).glob("*-deputy-2.mcap")):
        select.select_option(label=path.stem)
        case = int(path.stem.split("-")[2])
        page.wait_for_function("case_ => player.cases.numbers[player.row] === case_", arg=case)
        assert select.locator("option:checked").inner_text() == path.stem


def test_a_fleet_that_flies_alone_is_shown_with_all_deputies(opened, tmp_path):
    words = ("+experiment=fly", "controller=champion_27", "sun=random", "fleet.deputies=3", "case=4")
    experiment = run_of(tmp_path, ("record", "report"), *words)
    recordings = [read(path) for path in sorted((tmp_path / artifacts.RECORDINGS).glob("*.mcap"))]
    spent = sum(recording[MISSION]["delta_v_m_s"][-1] for recording in recordings)
    seen = recordings[0][MISSION]["inspected_count"][-1]
    text = (tmp_path / artifacts.REPORT).read_text(encoding="utf-8")
    points = f"{seen} of the 57 points that can be inspected (99 in all)"
    assert f"inspects {points} for {spent:.3f} m/s in total" in text
    (flight,) = gather(experiment, tmp_path).shown
    assert [part.name for part in flight.parts] == [f"case-4-deputy-{number}" for number in (1, 2, 3)]
    page = opened(text, reduced_motion="reduce")
    page.wait_for_function("() => globalThis.player?.sides?.[1].flight")
    fellows = page.evaluate(
        "() => player.shownSides.map(({ view }) => view.fellows.map(({ letter }) => letter).join(''))"
    )
    assert fellows == ["BC", "AC"]  # the third is not shown, but drawn
    page.locator("#player .chosen input").nth(2).check()
    page.wait_for_function("() => player.shownSides.length === 3")


def test_without_the_safety_layer_deputies_are_not_kept_apart(tmp_path):
    layer = ("safety=filter", "fleet.keep_apart_m=60", "deputy.max_distance_m=110")
    run_of(tmp_path, ("scenario", "evaluate", "report"), *WORDS, *layer)
    text = (tmp_path / artifacts.REPORT).read_text(encoding="utf-8")
    assert "the safety layer keeps them 60 m apart" in text
    episodes = pq.read_table(tmp_path / artifacts.EPISODES).to_pydict()
    acted = sum(periods > 0 for periods in episodes["safety_periods"])
    assert f"it acted in {acted} of {len(episodes['case'])} flights" in " ".join(text.split())
    assert re.search(r"Case \d+, deputy [12], with the safety layer and without", text)
