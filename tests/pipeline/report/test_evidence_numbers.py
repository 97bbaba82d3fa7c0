"""What the pages of evidence and of a board tell of made-up verdicts, each number written by hand."""

import html
import re
from dataclasses import replace
from datetime import date
from itertools import chain

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.model import And, Consequent, FuzzySystem, Is, Rule, Term, Triangular, Variable
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.assurance.judgements import ORDER
from pipeline.evaluation.assurance.requirements import SEVERITIES
from pipeline.report import board
from pipeline.report.board_flights import BoardFlights, Limit, draw_distances, flights_of_board, in_words
from pipeline.report.evidence import contexts, document, draw_margins, factors, lead, proved_by, run_in_words
from pipeline.settings.experiment import Mission
from plain_files.document import Fold, Items, Paragraph, Table
from tests.pipeline.evaluation.assurance.cases import facts_of
from tests.pipeline.report.test_drawings import read

CONDITIONS = {
    "num_cases": 2500,
    "seed": 7,
    "starts": "at 50 to 100 m and at rest",
    "sun": "random",
    "safety": "filter",
    "navigation": "fixes",
    "thrusters": "ideal",
    "dynamics": "cw",
    "dispersed": ["deputy.mass_kg"],
    "duration_s": 3600.0,
    "sample_period_s": 10.0,
    "settings": {},
}


def method(word="shown", verdict="shown", *, is_proof=False):
    return {"word": word, "verdict": verdict, "why": "for a reason", "is_proof": is_proof}


CASES = {
    "num_cases": 2500,
    "num_failed": 1234,
    "num_allowed": 1300,
    "needed_without_failure": 299,
    "low": 0.98765,
    "high": 0.5,
    "margin": -0.5,
    "median_margin": 2.25,
    "num_known": 1500,
    "premises": {"light": 1200},
    "histograms": [{"unit": "m", "least": -3.0, "edges": [-3.0, 0.0, 1.0], "counts": [1, 3]}],
}
WORST = {
    "found_by": "case 3",
    "margin": -3.0,
    "unit": "m",
    "recorded_margin": -3.00004,
    "position_m": [10.0, -20.5, 0.0],
    "velocity_m_s": [0.0, 0.0, 0.0],
    "sun_angle_rad": np.pi / 4.0,
    "sun_elevation_rad": 0.0,
    "settings": {"deputy.mass_kg": 11.123456789},
    "recording": "assure/R1-worst.mcap",
    "left_domain": [],
}


def requirement(number, verdict="shown", severity=SEVERITIES[0], **parts):
    entry = {"id": f"R{number}", "title": f"Title {number}", "text": f"Claim {number}.", "verdict": verdict}
    entry |= {
        "severity": severity,
        "consequence": "loss",
        "share": "99 % of cases",
        "sentence": f"S{number}.",
    }
    entry |= {"reason": "because.", "source": "a book", "accepted": "", "formula": None, "unit": "m"}
    return entry | {"methods": {"cases": method(verdict, verdict)}, "reach": "", "unproved": ""} | parts


def evidence(*requirements, **others):
    whole = {
        "name": "mine",
        "requirements": [*requirements],
        "conditions": CONDITIONS,
        "joint": None,
        "earlier": [],
    }
    whole |= {"controller": {"name": "law", "sha256": "a" * 64}, "config_hash": "c" * 64, "sources": "d" * 64}
    whole |= {"git_revision": "0123456789abcdef", "processor": {"compiled_for": "x86", "libm": "glibc"}}
    domain = {"num_made_from": 1000, "num_tried": 2000, "num_left": 1001, "confidence": 0.95, "high": 0.01}
    inputs = [{"name": "range", "unit": "m", "low": -1.5, "high": 20.25}]
    domain |= {"systems": [{"system": "force_x", "inputs": inputs}]}
    return whole | {"versions": {"product": "1.2"}, "sha256": {}, "domain": domain} | others


def rows_of(blocks):
    """The rows of all tables of two columns, by their first cell."""
    inside = chain.from_iterable(each.blocks if isinstance(each, Fold) else [each] for each in blocks)
    return {
        row[0]: row[1] for each in inside if isinstance(each, Table) for row in each.rows if len(row) == 2
    }


def test_facts_on_cases_are_those_that_were_counted():
    rows = rows_of(document(evidence(requirement(1, cases=CASES))).blocks)
    assert rows["flown"] == "2,500"
    assert rows["flown by earlier tries, not counted again"] == "1,500"
    assert rows["with light"] == "1,200"
    assert rows["failed"] == "1,234"
    assert rows["failures that the claim allows"] == "at most 1,300"
    assert rows["cases needed without a failure"] == "299"
    assert rows["share that meets it, one-sided bounds"] == "98.765 % to 50 %"
    assert rows["margin, at the claim's share"] == "at least −0.5 m"
    assert rows["median margin"] == "2.25 m"
    assert rows["worst margin"] == "−3 m"


@pytest.mark.parametrize(("allowed", "needed"), [(0, 299), (-1, 299), (-1, None)])
def test_too_few_cases_are_told_where_no_failure_is_allowed(allowed, needed):
    cases = CASES | {"num_allowed": allowed, "needed_without_failure": needed, "margin": None, "num_known": 0}
    rows = rows_of(document(evidence(requirement(1, cases=cases | {"is_sequential": True}))).blocks)
    few = "too few cases" if needed else "all cases must meet it: only a proof shows it"
    assert rows["failures that the claim allows"] == ("at most 0" if allowed == 0 else few)
    assert rows["cases needed without a failure"] == ("299" if needed else "no number is enough")
    assert rows["margin, at the claim's share"] == few
    assert "flown by earlier tries, not counted again" not in rows
    assert "share that meets it, for any number of flights" in rows


def test_margins_of_several_units_have_no_median():
    both = [{**CASES["histograms"][0], "unit": unit} for unit in ("m", "m/s")]
    rows = rows_of(
        document(evidence(requirement(1, unit="mixed", cases=CASES | {"histograms": both}))).blocks
    )
    assert rows["worst margin"] == "−3 m and −3 m/s"
    assert "median margin" not in rows


def test_facts_on_searches_and_rare_failures_are_theirs():
    search = {
        "num_flights": 12345,
        "flights_per_find": 1234.4,
        "random_flights_per_find": 56789.0,
        "ratio": 46.04,
    }
    search |= {
        "worst_margin": -1.0,
        "worst_unit": "m",
        "random_worst_margin": 0.25,
        "random_worst_unit": "m/s",
    }
    search |= {"num_found": 3, "num_searches": 8, "sentence": "it was quick"}
    splitting = {"share": 1.234e-5, "low": 1e-6, "high": 1e-4, "num_flights": 54321}
    splitting |= {"levels": [2.0, 0.12345], "populations": [1e-5, 2e-5]}
    methods = {name: method() for name in ("cases", "search", "splitting")}
    of_both = requirement(1, search=search, splitting=splitting, methods=methods)
    rows = rows_of(document(evidence(of_both)).blocks)
    assert rows["flights of all searches"] == "12,345"
    assert rows["flights for each failure found"] == "1,234"
    assert rows["flights at random for each failure"] == "56,789"
    assert rows["faster than at random"] == "46.0 times"
    assert rows["worst margin found"] == "−1 m"
    assert rows["worst margin at random"] == "0.25 m/s"
    assert rows["share of cases that fail it"] == "1.23e-05"
    assert rows["one-sided bounds"] == "1e-06 to 0.0001"
    assert rows["flights"] == "54,321"
    assert rows["levels of the margin"] == "2, 0.1235"
    assert rows["by each population"] == "1e-05, 2e-05"
    nothing = search | dict.fromkeys(("flights_per_find", "random_flights_per_find", "ratio"))
    none = requirement(
        1, search=nothing, splitting=splitting | {"share": None, "high": None}, methods=methods
    )
    rows = rows_of(document(evidence(none)).blocks)
    assert (
        rows["flights for each failure found"] == rows["flights at random for each failure"] == "none found"
    )
    assert rows["faster than at random"] == "no ratio"
    assert (rows["share of cases that fail it"], rows["one-sided bounds"]) == ("no estimate", "none")


@pytest.mark.parametrize(("num_left", "times"), [(0, "never"), (1, "once"), (2, "2 times")])
def test_facts_on_the_worst_case_are_those_of_its_start(num_left, times):
    left = {
        "system": "s",
        "name": "x",
        "unit": "m",
        "value": 9.87654,
        "first_s": 10.0,
        "last_s": 20.0,
        "low": -1.0,
        "high": 2.0,
    }
    worst = WORST | {"left_domain": [left] * num_left}
    blocks = document(evidence(requirement(1, worst=worst))).blocks
    rows = rows_of(blocks)
    assert rows["found by"] == "case 3"
    assert rows["margin"] == rows["margin of the recording, read back"] == "−3 m"
    assert rows["start, Hill axes"] == "(10.000, −20.500, 0.000) m"
    assert "velocity there" not in rows
    assert rows["Sun at the start"] == "45.00°"
    assert rows["deputy.mass_kg"] == "11.1235"
    assert rows["left the operational domain"] == times
    (fold,) = (each for each in blocks if isinstance(each, Fold) and "worst case" in each.words)
    items = [words for each in fold.blocks if isinstance(each, Items) for words in each.items]
    assert items == ["s senses x up to 9.877 m from 10 to 20 s, outside -1 to 2 m"] * num_left
    moving = document(evidence(requirement(1, worst=WORST | {"velocity_m_s": [0.0, -0.25, 0.0]}))).blocks
    assert rows_of(moving)["velocity there"] == "(0.000, −0.250, 0.000) m/s"
    proved = requirement(1, worst=WORST, methods={"bounds": method(is_proof=True)})
    of_deputy = requirement(1, worst=WORST | {"deputy": 2})
    for entry in (proved, of_deputy):
        assert "left the operational domain" not in rows_of(document(evidence(entry)).blocks)
    assert rows_of(document(evidence(of_deputy)).blocks)["deputy with this margin"] == "2"


def test_the_domain_is_told_with_its_shares():
    whole = document(evidence(requirement(1)))
    words = " ".join(each.words for each in whole.blocks if isinstance(each, Paragraph))
    assert "The box of inputs that 1,000 flights met. Of 2,000 other flights" in words
    assert "1,001 leave it; with 95 % confidence no more than 1 % of such flights do" in words
    (table,) = (each for each in whole.blocks if isinstance(each, Table) and each.heads[:1] == ["input"])
    assert table.rows == [["range (m)", "force_x", "−1.5", "20.25"]]


def test_the_lead_is_the_gravest_of_the_worst_verdict():
    worst_first = [*reversed(ORDER)]
    entries = [
        requirement(10 * i + j, verdict, severity)
        for i, verdict in enumerate(worst_first)
        for j, severity in enumerate(SEVERITIES)
    ]
    for count in range(len(entries)):
        # the first of those left is the worst, wherever it stands
        left = [*entries[count:][1:], entries[count]]
        words = lead(evidence(*left))
        assert words.startswith(
            f"{entries[count]['id']}, {entries[count]['severity']}. {entries[count]['sentence']}"
        )
        rest = [each for each in left if each is not entries[count]]
        for verdict in ORDER:
            names = ", ".join(each["id"] for each in rest if each["verdict"] == verdict)
            assert (f"{names}: {verdict}" in words) == bool(names)
    assert board.gravest(entries) is None
    flown = [each | {"worst": WORST} for each in entries]
    assert board.gravest([*reversed(flown)]) is flown[0]


def test_a_proof_shows_a_requirement_only_where_it_is_shown():
    for name in ("tube", "safety_layer", "bounds"):
        proved = requirement(1, methods={"cases": method(), name: method(is_proof=True)})
        assert proved_by(proved) == name
        assert proved_by(proved | {"verdict": "not shown"}) == ""
        assert proved_by(requirement(1, methods={name: method(is_proof=False)})) == ""
    links = dict(contexts(evidence(requirement(1))))
    assert links["provenance"] == (
        "starts at 50 to 100 m and at rest; Sun random; safety filter; flights of 3,600 s, sampled every 10 s"
    )
    assert "domain" in links
    by_proof = requirement(2, methods={"bounds": method(is_proof=True)})
    assert [link for link, _ in contexts(evidence(by_proof))] == ["provenance", "R2-bounds"]
    assert [link for link, _ in contexts(evidence(requirement(1), by_proof))][1:] == ["domain", "R2-bounds"]


def test_what_was_flown_and_what_is_uncertain_is_in_words():
    assert run_in_words(evidence()) == (
        'Requirements "mine"; 2,500 cases, seed 7, Sun random, safety filter, '
        "with errors of navigation, deputy.mass_kg."
    )
    sure = CONDITIONS | {"sun": "fixed", "navigation": "perfect", "dispersed": []}
    assert run_in_words(evidence(conditions=sure)).endswith("2,500 cases, seed 7, Sun fixed, safety filter.")
    drawn = {row[0]: row[2] for row in factors(evidence())}["uncertainty characterization"]
    assert drawn.endswith("over 2,500 cases for start, Sun, errors of navigation and deputy.mass_kg")
    alone = {row[0]: row[2] for row in factors(evidence(conditions=sure))}["uncertainty characterization"]
    assert alone.endswith("over 2,500 cases for start")
    flown = {row[0]: row[2] for row in factors(evidence(requirement(1, worst=WORST), requirement(2)))}
    assert flown["verification"].startswith("1 worst flights were flown again")
    searched = requirement(1, search={"num_flights": 4000}, bounds=[{"num_boxes": 30}, {"num_boxes": 1200}])
    robust = {
        row[0]: row[2] for row in factors(evidence(searched, requirement(2, search={"num_flights": 1})))
    }
    assert robust["results robustness"].startswith("4,001 flights search for the worst cases; 1,230 boxes")


def flights(count=3, after=True):
    times, then = np.arange(0.0, 61.0, 10.0), np.arange(0.0, 1801.0, 30.0)
    distances = np.linspace(40.0, 90.0, count)[:, np.newaxis] + 0.0 * times
    onwards = distances[:, -1:] + 0.1 * np.arange(count)[:, np.newaxis] * then
    return BoardFlights(count, times, distances, *((then, onwards) if after else ()))


def board_of(*entries, systems=(), flown=None, **others):
    page = board.render_board(
        evidence(*entries, **others), systems, flown or flights(), None, date(2026, 1, 2)
    )
    return page, html.unescape(" ".join(re.sub("<[^>]*>", " ", page).split()))


def test_a_board_s_row_has_counts_and_the_least_margin():
    entries = [
        requirement(1, "refuted", cases=CASES, worst=WORST),
        requirement(2, cases=CASES | {"num_allowed": -1, "num_failed": 0}, worst=WORST | {"margin": 0.5}),
        requirement(3, cases=CASES, methods={"bounds": method(is_proof=True)}),
        requirement(4),
    ]
    page, words = board_of(*entries)
    cells = re.findall(r'data-head="flights">(.*?)</td>.*?class="number">(.*?)(?:<small>|</td>)', page)
    assert [tuple(map(html.unescape, row)) for row in cells] == [
        ("1,234 of 2,500 fail; 1,300 allowed", "−3 m"),
        ("0 of 2,500 fail; 2,500 are too few", "+0.5 m"),
        ("1,234 of 2,500 fail", ""),
        ("not flown", ""),
    ]
    assert "3 of 4 requirements are shown, 1 is not. Refuted: R1 Title 1." in words
    assert "None is refuted" not in words
    assert board.lead(entries[1:])[0] == "All 3 requirements are shown."
    assert board.lead([requirement(1), requirement(2, "not shown")]) == (
        "1 of 2 requirements is shown, 1 is not.",
        "Not shown: R2 Title 2. None is refuted.",
    )


def test_a_board_tells_what_was_judged_in_short():
    page, words = board_of(requirement(1))
    facts = dict(re.findall(r"<div><dt>(.*?)</dt><dd[^>]*>(.*?)</dd></div>", page))
    assert facts["its SHA-256"] == "a" * 16 + "…"
    assert facts["software"] == "1.2, revision 0123456789ab"
    assert facts["cases"] == "2,500, seed 7"
    assert facts["flights"] == "3,600 s, sampled every 10 s"
    assert facts["evidence made"] == "2 January 2026"
    assert facts["safety layer"] == "filter"
    assert "Flights longer than 3,600 s" in words
    assert "the Sun other than" not in words
    assert "the Sun other than fixed" in board_of(requirement(1), conditions=CONDITIONS | {"sun": "fixed"})[1]
    assert dict(
        re.findall(
            r"<dt>(safety layer)</dt><dd>(.*?)</dd>",
            board_of(requirement(1), conditions=CONDITIONS | {"safety": "none"})[0],
        )
    ) == {"safety layer": "off"}


def test_a_board_tells_what_is_not_covered():
    far = requirement(1, formula="always (distance <= 200 m)", reach="at samples")
    unproved = requirement(2, unproved="bounds")
    _, words = board_of(far, unproved, requirement(3, "not shown"))
    # the third moves away by 0.2 m/s from 90 m, the second by 0.1 m/s from 65 m
    assert "without a further push 67 % of these flights are beyond 200 m within 30 min" in words
    assert "R2 Title 2 has no proof, though one was asked for." in words
    assert "R3 Title 3 is not shown." in words
    assert "R1 Title 1 is" not in words
    assert "What happens between samples, 10 s apart" in words
    assert "(1,001 of 2,000 fresh flights left it)" in words
    proved = requirement(
        1,
        methods={"safety_layer": method(is_proof=True)},
        safety_layer={"assumed": ["calm", "near"], "starts": "near"},
    )
    _, words = board_of(proved, proved)
    assert words.count("which a proof assumes: calm.") == 1
    assert "fresh flights left it" not in words
    assert "What happens between samples" not in words


def test_shares_beyond_a_limit_are_told_for_each_span():
    limits = [Limit(100.0, ("R1",), ("Near",)), Limit(150.0, ("R2",), ("Far",))]
    # of three: 40 m at rest, 65 m + 0.1 m/s, 90 m + 0.2 m/s
    words = in_words(flights(), limits)
    ends = [[40.0, 65.0 + 6.0 * minutes, 90.0 + 12.0 * minutes] for minutes in (5, 10, 20, 30)]
    shares = ", ".join(f"{100.0 * np.mean(np.array(each) > 150.0):.1f}" for each in ends)
    assert f"Beyond 150 m within 5, 10, 20, 30 min after the end: {shares} % of cases." in words
    assert "Lines: 100 m: Near; 150 m: Far." in words
    assert "Dashed" not in in_words(flights(after=False), limits)
    # a limit that flights begin beyond is none that free motion is told of
    assert "Beyond 100 m within" in in_words(flights(), [limits[0], Limit(80.0, ("R3",), ("Nearer",))][:1])
    assert "Beyond" not in in_words(flights(), [Limit(80.0, ("R3",), ("Nearer",))])
    many = replace(flights(300), num_cases=5000)
    assert in_words(many, limits).startswith("The first 200 of 5,000 cases; ")
    assert in_words(many, limits).endswith(" % of 300 cases.")


@pytest.mark.parametrize(("span_s", "unit"), [(60.0, 0.2), (3600.0, 10.0), (5400.0, 15.0)])
def test_ticks_of_a_drawing_are_round_and_about_as_many_as_fit(span_s, unit):
    times = np.linspace(0.0, span_s, 7)
    elements, _, _ = read(draw_distances(BoardFlights(1, times, np.full((1, 7), 80.0)), []))
    minutes = [float(each.text.removesuffix(" min")) for each in elements if each.get("class") == "middle"]
    np.testing.assert_allclose(minutes, unit * np.arange(len(minutes)), atol=1e-9)
    assert 4 <= len(minutes) <= 7
    levels = [float(each.text) for each in elements if each.get("class") == "end"]
    np.testing.assert_allclose(levels, 30.0 * np.arange(3))


def test_words_of_limits_stand_a_line_apart_from_the_lowest_up():
    limits = [Limit(value, (f"R{value:g}",), ("T",)) for value in (10.0, 11.0, 12.0, 100.0)]
    elements, width, height = read(draw_distances(flights(), limits))
    words = [each for each in elements if each.get("class") == "limit" and each.text]
    lines = [float(each.get("y1")) for each in elements if each.get("class") == "limit" and not each.text]
    values, names = ([float(each.get("y")) for each in words[first::2]] for first in (0, 1))
    np.testing.assert_allclose(np.subtract(names, values), 11.0)
    np.testing.assert_allclose(np.subtract(values[:3], values[0]), [0.0, -22.0, -44.0])
    assert values[0] == pytest.approx(lines[0] + 4.0, abs=0.11)
    assert values[3] == pytest.approx(lines[3] + 4.0, abs=0.11)
    assert max(lines) < height
    # right of what is drawn, where nothing hides them
    ends = {float(each.get("x2")) for each in elements if each.get("class") == "limit" and not each.text}
    assert all(max(ends) < float(each.get("x")) < width for each in words)


def graded(values):
    """A system of two inputs whose rules ask for some of five pushes, by their names."""
    low, high = Triangular(0.0, 0.0, 1.0), Triangular(0.0, 1.0, 1.0)
    inputs = [
        Variable(name, "m", 0.0, 1.0, terms=(Term("near", low), Term("far_off", high)))
        for name in ("down", "across")
    ]
    terms = tuple(Term(f"push_{k}", Triangular(k - 0.5, k * 1.0, k + 0.5)) for k in (-2, -1, 0, 1, 2))
    output = Variable("push_up", "N", -2.5, 2.5, terms=terms, default=0.0, description="upwards")
    cells = zip([(i, j) for i in ("near", "far_off") for j in ("near", "far_off")], values, strict=True)
    rules = tuple(
        Rule(And((Is("down", i), Is("across", j))), (Consequent("push_up", f"push_{k}"),))
        for (i, j), k in cells
    )
    return FuzzySystem("push_up", tuple(inputs), (output,), rules)


def test_cells_of_a_grid_tell_sign_and_strength():
    grid = board.grid_of(graded([-2, 0, 1, 2]))
    cells = [cell for _, row in grid.rows for cell in row]
    assert [(cell.number, cell.term, cell.sign, cell.strength) for cell in cells] == [
        (1, "push -2", "minus", 4),
        (2, "push 0", "zero", 0),
        (3, "push 1", "plus", 2),
        (4, "push 2", "plus", 4),
    ]
    assert [cell.value for cell in cells] == ["−2", "0", "+1", "+2"]
    assert grid.title == "push up: upwards"
    assert grid.heads == [("near", "0"), ("far off", "+1")]
    assert board.grid_of(graded([0, 0, 0, 0])).rows[0][1][0].strength == 0


def test_rules_are_printed_unless_they_are_too_many():
    system = graded([-2, 0, 1, 2])
    for count, is_printed in ((15, True), (16, False)):  # 60 and 64 rules
        page, words = board_of(requirement(1), systems=[system] * count)
        assert (page.count('<div class="grid">') == count) == is_printed
        assert ("rules do not fit on a sheet" in words) == (not is_printed)
        assert f"The {4 * count} rules, their numbers and what they sense" in words
    assert "The controller has no rules." in board_of(requirement(1))[1]


def test_free_motion_after_the_end_is_where_an_integrator_leads():
    mission = Mission()
    rng = np.random.default_rng(3)
    states = np.column_stack([rng.uniform(-150.0, 150.0, (20, 3)), rng.uniform(-0.3, 0.3, (20, 3))])
    tracks = np.repeat(states[:, np.newaxis], mission.num_controls + 1, axis=1)
    motion = flights_of_board(facts_of(mission), tracks, 20)
    n = mission.orbit.mean_motion_rad_s

    def moves(_, state):
        x, _, z, vx, vy, vz = state
        return [vx, vy, vz, 3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z]

    times = np.arange(0.0, 1801.0, 30.0)
    expected = [
        np.linalg.norm(
            solve_ivp(moves, (0.0, 1800.0), state, t_eval=times, rtol=1e-11, atol=1e-9).y[:3], axis=0
        )
        for state in states
    ]
    np.testing.assert_allclose(motion.time_s, 10.0 * np.arange(mission.num_controls + 1))
    np.testing.assert_allclose(motion.distance_m[:, 0], np.linalg.norm(states[:, :3], axis=1))
    np.testing.assert_allclose(motion.after_s, times)
    np.testing.assert_allclose(motion.after_m, expected, rtol=1e-6)
    for minutes in (5, 30):
        share = 100 * np.mean([np.any(far[: 2 * minutes + 1] > 200.0) for far in expected])
        assert motion.percent_beyond(200.0, minutes) == share


@pytest.mark.parametrize("control_period_s", [7.0, 10.0, 40.0])
@pytest.mark.parametrize("word", ["dynamics=cw", "dynamics=two_body"])
def test_what_follows_the_end_has_its_times_whatever_the_period(control_period_s, word):
    words = (word, f"control_period_s={control_period_s}", f"duration_s={20 * control_period_s}")
    mission = compose_experiment(["+experiment=evaluate", "controller=coast", *words]).experiment.mission
    state = np.array([40.0, -60.0, 25.0, 0.03, -0.05, 0.02])
    motion = flights_of_board(facts_of(mission), np.tile(state, (1, mission.num_controls + 1, 1)), 1)
    assert np.diff(motion.after_s).max() <= max(30.0, control_period_s) + 2.0
    # the closed form of a circular orbit, which no table has
    n, s, c = (
        (rate := mission.orbit.mean_motion_rad_s),
        *(f(rate * motion.after_s) for f in (np.sin, np.cos)),
    )
    x, y, z, vx, vy, vz = state
    expected = [
        (4 - 3 * c) * x + s / n * vx + 2 / n * (1 - c) * vy,
        6 * (s - n * motion.after_s) * x + y - 2 / n * (1 - c) * vx + (4 * s / n - 3 * motion.after_s) * vy,
        c * z + s / n * vz,
    ]
    np.testing.assert_allclose(motion.after_m[0], np.linalg.norm(expected, axis=0), atol=0.05)


def test_of_fleets_each_deputy_has_a_flight():
    mission = compose_experiment(
        ["+experiment=evaluate", "controller=coast", "fleet.deputies=2"]
    ).experiment.mission
    tracks = np.zeros((3, 2, mission.num_controls + 1, 6))
    tracks[..., 1] = 40.0 + 10.0 * np.arange(6.0).reshape(3, 2, 1)
    motion = flights_of_board(facts_of(mission), tracks, 3)
    assert (motion.num_cases, motion.noun) == (6, "deputy")
    np.testing.assert_allclose(motion.distance_m[:, 0], [40.0, 50.0, 60.0, 70.0, 80.0, 90.0])
    docking = compose_experiment(["+experiment=fly", "problem=docking"]).experiment.mission
    assert flights_of_board(facts_of(docking), tracks[:, 0], 3).after_m.size == 0


def test_a_histogram_marks_its_zero_where_margins_lie_on_both_sides():
    for low, marks in ((-2.0, ["−2", "3", "0"]), (0.5, ["0.5", "3"]), (-0.1, ["3", "0"])):
        elements, _, _ = read(draw_margins({"edges": [low, 1.0, 3.0], "counts": [4, 5]}, "", "R1"))
        of_axis = [each for each in elements if each.get("class") in ("start", "middle", "end")]
        of_axis = [each for each in of_axis if not each.text.startswith("margin")]
        assert [each.text for each in of_axis] == marks
        ends = {each.text: float(each.get("x")) for each in of_axis}
        bars = [each for each in elements if each.tag == "rect"]
        first, second = (float(bar.get("x")) for bar in bars)
        length = (second - first) / (1.0 - low)
        assert ends["3"] == pytest.approx(first + length * (3.0 - low), abs=0.2)
        # a unit is left between bars
        assert float(bars[0].get("width")) == pytest.approx(second - first - 1.0, abs=0.11)
