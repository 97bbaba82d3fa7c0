"""Evidence in miniature: its files, that its parts agree, and that the page says no more than it."""

import hashlib
import html
import re
import shutil
from datetime import date
from itertools import product

import numpy as np
import pyarrow.parquet as pq
import pytest

from fis_tools.analysis.domain import from_mapping
from fis_tools.formats import serialize
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import load
from pipeline.evaluation.assurance.campaign import Campaign
from pipeline.evaluation.assurance.conditions import changed_settings
from pipeline.evaluation.assurance.judgements import judge
from pipeline.evaluation.assurance.repeats import earlier_tries
from pipeline.evaluation.assurance.requirements import load_requirements
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.recording.recorder import FlightRecorder
from pipeline.report import worst_flight
from pipeline.report.board import MOTION, render_board
from pipeline.report.board_flights import flights_of_board, limits_of
from pipeline.report.evidence import OF_PAPER, OF_RUN, render_evidence
from pipeline.report.figures.flights import draw_flight
from pipeline.report.worst_flight import record_worst
from pipeline.run import artifacts, manifests
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from pipeline.settings.groups import variants_of
from pipeline.settings.mission import Dynamics
from pipeline.settings.places import conf_folder, requirements_path
from tests import night
from tests.browser import serious_violations
from tests.fis_tools.control_systems import build_simulation
from tests.pipeline.evaluation.assurance.cases import facts_of
from tests.pipeline.evaluation.propagated import linear
from tests.policies import check_policy, check_references, source_hash

pytestmark = pytest.mark.slow

FEW = ("sun=random", "assurance.num_cases=60", "assurance.searches=2", "assurance.search_starts=6")
FEW += ("assurance.search_population=5", "assurance.search_generations=2", "assurance.domain_cases=4")
SMALL = ("controller=champion_any_sun", *FEW)


@pytest.fixture(scope="module")
def assured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("assured") / "run"
    assert main(["+experiment=assure", *SMALL, f"hydra.run.dir={folder}"]) == 0
    return folder


@pytest.fixture(scope="module")
def evidence(assured):
    return artifacts.read_json(assured, artifacts.EVIDENCE)


def test_verdicts_follow_from_the_table_of_cases(assured, evidence):
    table = pq.read_table(assured / artifacts.ASSURED_CASES)
    assert table.num_rows == 60
    for entry in (entry for entry in evidence["requirements"] if "cases" in entry):
        margins, met = (table[f"{entry['id']}_{what}"].to_numpy() for what in ("margin", "met"))
        again, flown = judge(margins, met, entry["probability"], entry["confidence"]), entry["cases"]
        assert entry["methods"]["cases"]["verdict"] == again.verdict
        assert flown["num_failed"] == int((~met).sum())
        assert flown["worst_margin"] == margins.min()
        # one unit a histogram, and each case in one of them
        drawn = flown["histograms"]
        units = [histogram["unit"] for histogram in drawn]
        assert len(set(units)) == len(units)
        assert "mixed" not in units
        assert entry["unit"] in ("mixed", *units)
        assert sum(sum(histogram["counts"]) for histogram in drawn) == 60
        ends = [zip(histogram["edges"][1:], histogram["counts"], strict=True) for histogram in drawn]
        below = sum(count for pairs in ends for edge, count in pairs if edge <= 0.0)
        assert below == int((margins < 0.0).sum())
        assert min(histogram["least"] for histogram in drawn) == margins.min()
    # too few cases show nothing
    by_id = {entry["id"]: entry for entry in evidence["requirements"]}
    assert by_id["R2"]["methods"]["cases"]["verdict"] == "not shown"
    assert "needs 230 cases" in by_id["R2"]["methods"]["cases"]["why"]
    assert by_id["R6"]["verdict"] == "shown"


def test_no_word_shown_stands_without_its_share_and_consequence(assured, evidence):
    shown = [entry for entry in evidence["requirements"] if entry["verdict"] == "shown"]
    assert len(shown) >= 3
    consequences = [entry["consequence"] for entry in evidence["requirements"]]
    text = (assured / artifacts.EVIDENCE_PAGE).read_text(encoding="utf-8")
    body = re.sub(r"<(title|style|script|caption|figcaption).*?</\1>", "", text, flags=re.DOTALL)
    drawn = "".join(re.findall(r"<svg.*?</svg>", body, re.DOTALL))
    written = re.sub(r"<svg.*?</svg>", "", body, flags=re.DOTALL)
    # what a reader takes in at once: a paragraph, a row, a node of the drawing
    units = re.split(r"</?(?:p|tr|li|h\d|summary)\b", written) + drawn.split("</a>")
    sentences = [" ".join(re.sub("<[^>]*>", " ", unit).split()) for unit in units]
    sentences = [words for words in sentences if re.search(r"(?<!not )\bshown\b", words, re.IGNORECASE)]
    assert len(sentences) >= 3 * len(shown)
    for words in sentences:
        assert re.search(r"%|all (cases|inputs) \(proved\)", words), words
        assert any(consequence in words for consequence in consequences), words
    for entry in evidence["requirements"]:
        assert entry["sentence"].startswith(entry["verdict"].capitalize())
        assert entry["share"] in entry["sentence"]
        assert entry["consequence"] in entry["sentence"]


def test_the_worst_case_is_recorded_and_judged_again(assured, evidence):
    searched = pq.read_table(assured / artifacts.SEARCHED)
    names = np.array(searched["requirement"].to_pylist())
    for entry in (entry for entry in evidence["requirements"] if "worst" in entry):
        worst = entry["worst"]
        assert (assured / worst["recording"]).stat().st_size > 1000
        # a day's coasting makes centimetres of what single precision leaves out
        tolerance = 0.05 if "coasting" in entry["formula"] else 1e-4
        assert worst["recorded_margin"] == pytest.approx(worst["margin"], abs=tolerance)
        of_searches = searched["margin"].to_numpy()[names == entry["id"]]
        assert worst["margin"] == min([entry["cases"]["worst_margin"], *of_searches])
    assert set(names) == {
        entry["id"] for entry in evidence["requirements"] if "search" in entry["verified_by"]
    }
    flights = sorted(path.name for path in (assured / artifacts.WORST_FLIGHTS).iterdir())
    assert flights == [f"R{number}-worst.mcap" for number in (1, 2, 3, 4, 5, 7, 8)]


def test_proofs_and_domain_are_files(assured, evidence):
    boxes = pq.read_table(assured / artifacts.PROOF_BOXES)
    counted = sum(part["num_boxes"] for entry in evidence["requirements"] for part in entry.get("bounds", ()))
    assert boxes.num_rows == 3 * counted
    domain = from_mapping(artifacts.read_json(assured, artifacts.DOMAIN), "domain")
    assert [box.system for box in domain] == ["force_x", "force_y", "force_z"]
    assert evidence["domain"]["num_made_from"] == evidence["domain"]["num_tried"] == 4
    # hashes are those of the files
    assert {artifacts.REQUIREMENTS, artifacts.ASSURED_CASES, artifacts.DOMAIN} < set(evidence["sha256"])
    for name, digest in evidence["sha256"].items():
        assert hashlib.sha256((assured / name).read_bytes()).hexdigest() == digest
    assert artifacts.EVIDENCE_PAGE in manifests.read(assured)["sha256"]


def test_the_page_is_what_the_data_says_and_needs_nothing_else(assured, evidence):
    written = (assured / artifacts.EVIDENCE_PAGE).read_text(encoding="utf-8")
    # the only script is the player of the worst flights
    assert written.count("<script>") == 1
    assert 'id="player"' in written
    assert all(entry["sentence"] in html.unescape(written) for entry in evidence["requirements"])
    text = render_evidence(evidence)
    check_policy(text)
    assert f"style-src '{source_hash(re.findall(r'<style>(.*?)</style>', text, re.DOTALL)[0])}'" in text
    assert not re.search(r"<script|<link|style=\"|src=|https?:", text)
    sections = {"verdicts", "argument", "requirements", "domain", "credibility", "provenance"}
    assert sections <= set(re.findall(r'<section id="(\w+)"', text))
    check_references(text)
    for entry in evidence["requirements"]:
        for method in entry["methods"]:
            assert f'href="#{entry["id"]}-{method}"' in text
    # words of the file are words on the page
    hostile = '<script>alert("x")</script>'
    words = ("title", "text", "sentence", "consequence", "reason", "source")
    requirement = {**evidence["requirements"][0], **dict.fromkeys(words, hostile)}
    text = render_evidence({**evidence, "requirements": [requirement], "name": hostile})
    assert "<script" not in text
    assert text.count("&lt;script&gt;") >= 4


def test_the_page_tells_of_a_world_of_ones_own(evidence):
    assert evidence["conditions"]["settings"] == {"sun.mode": "random", "safety.kind": "filter"}
    assert OF_PAPER in render_evidence(evidence)
    mine = changed_settings({"deputy": {"mass_kg": 20.0, "max_force_n": 1}, "sun": {"mode": "fixed"}})
    assert mine == {"deputy.mass_kg": 20.0}
    text = render_evidence({**evidence, "conditions": {**evidence["conditions"], "settings": mine}})
    assert OF_RUN in text
    assert OF_PAPER not in text
    assert re.search(r"deputy\.mass_<wbr>kg</t[hd]>\s*<td[^>]*>20.0 kg<", text)


def test_the_argument_stands_as_the_worst_of_its_goals_and_names_their_shares(evidence):
    share = "99 % of cases or more (proved, if estimates are near, if motion is linear)"
    shown = {**evidence["requirements"][0], "verdict": "shown", "share": share}
    for worst in ("shown in part", "not shown", "refuted"):
        text = render_evidence({**evidence, "requirements": [shown, {**shown, "verdict": worst}, shown]})
        assert f"G0: {worst}<" in text
        assert ">S1" not in text  # a requirement may have this id
        assert f"R1: {worst} for 99 % (proved)<" in text


def test_runs_of_the_same_question_beside_are_told(assured, evidence, tmp_path, capsys):
    assert evidence["earlier"] == []
    beside = tmp_path / "beside"
    shutil.copytree(assured, beside / "run")
    other = ["+experiment=assure", *SMALL, "seed=2", f"hydra.run.dir={beside / 'again'}"]
    assert main(other) == 0
    errors = capsys.readouterr().err
    again = artifacts.read_json(beside / "again", artifacts.EVIDENCE)
    verdicts = {entry["id"]: entry["verdict"] for entry in evidence["requirements"]}
    assert again["earlier"] == [{"folder": "run", "seed": 1, "num_cases": 60, "verdicts": verdicts}]
    for text in (errors, (beside / "again" / artifacts.EVIDENCE_PAGE).read_text(encoding="utf-8")):
        assert (
            "Another try judged the same controller under the same conditions by other flights. run (seed 1"
            in text
        )
    for entry in (entry for entry in again["requirements"] if "cases" in entry):
        assert (entry["cases"]["num_tries"], entry["cases"]["num_known"]) == (1, 0)
        assert entry["cases"]["confidence"] >= entry["confidence"]
    # another question, and what cannot be read, are none of them
    question = {**again, "controller": {"name": "other", "sha256": "0"}}
    assert earlier_tries(beside / "again", question) == []
    for name, content in (("torn", "{"), ("list", "[]"), ("bare", "{}")):
        path = tmp_path / "apart" / name / artifacts.EVIDENCE
        path.parent.mkdir(parents=True)
        path.write_text(content, encoding="utf-8")
    assert earlier_tries(tmp_path / "apart" / "mine", again) == []


def test_what_was_refuted_is_not_shown_by_a_second_try(assured, evidence, tmp_path, ran):
    """In the same folder with fewer cases, and in one below it."""
    folder = tmp_path / "run"
    shutil.copytree(assured, folder)
    before = {entry["id"]: entry for entry in evidence["requirements"] if "cases" in entry}
    path = folder / artifacts.LEDGER
    path.write_text(path.read_text().replace('"by_cases": "shown"', '"by_cases": "refuted"'))
    forged = path.read_bytes()
    few = ["assurance.num_cases=30"]
    ran("stages=[assure]", *few, f"hydra.run.dir={folder}", code=None)
    ran("+experiment=assure", *SMALL, *few, f"hydra.run.dir={folder / 'deeper' / 'run'}", code=None)
    assert path.read_bytes().startswith(forged)
    assert len(path.read_bytes().splitlines()) == 2
    for second in (folder, folder / "deeper" / "run"):
        again = artifacts.read_json(second, artifacts.EVIDENCE)
        assert [run["num_cases"] for run in again["earlier"]] == [60]
        for entry in (entry for entry in again["requirements"] if "cases" in entry):
            assert entry["methods"]["cases"]["verdict"] != "shown"
            if before[entry["id"]]["methods"]["cases"]["verdict"] == "shown":
                assert "another try refuted it" in entry["methods"]["cases"]["why"]
            assert (entry["cases"]["num_cases"], entry["cases"]["num_known"]) == (0, 30)
    path.write_text("{")
    message = "what was tried must not be forgotten"
    assert message in ran("stages=[assure]", *few, f"hydra.run.dir={folder}", code=2).err


def test_it_repeats_to_the_last_bit(assured, evidence):
    recorded = {name: digest for name, digest in evidence["sha256"].items() if name.endswith("parquet")}
    assert main(["stages=[assure]", f"hydra.run.dir={assured}"]) == 0
    again = artifacts.read_json(assured, artifacts.EVIDENCE)
    assert {name: again["sha256"][name] for name in recorded} == recorded
    assert again["requirements"] == evidence["requirements"]


def test_mistakes_in_requirements_are_told_before_a_folder_is_made(tmp_path, ran):
    mine = tmp_path / "mine.yaml"
    mine.write_text("schema: requirements\nschema_version: 2\nrequirements: [{id: A1}]\n", encoding="utf-8")
    words = ["+experiment=assure", *SMALL, f"hydra.run.dir={tmp_path / 'run'}"]
    assert "A1: verified_by must be a list" in ran(*words, f"assurance.requirements={mine}", code=2).err
    shipped = requirements_path("inspection").read_text(encoding="utf-8")
    mine.write_text(shipped.replace("ask: force_y > ", "ask: force_Y > "), encoding="utf-8")
    error = ran(*words, f"assurance.requirements={mine}", code=2).err
    fault = "R6, its bounds 'force_Y > 1': no system of champion_any_sun has this output; did you mean"
    assert fault in error
    assert not (tmp_path / "run").exists()


def test_a_controller_without_systems_has_no_domain_and_what_is_asked_of_them_is_told_last(tmp_path, capsys):
    words = ["+experiment=assure", *FEW, "controller=coast"]
    assert main([*words, f"hydra.run.dir={tmp_path / 'run'}"]) == 3
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1] == "no proof was found, though one was asked for, of R6 (bounds)"
    gathered = artifacts.read_json(tmp_path / "run", artifacts.EVIDENCE)
    assert gathered["domain"] is None
    assert not (tmp_path / "run" / artifacts.DOMAIN).exists()
    assert {entry["id"]: entry["verdict"] for entry in gathered["requirements"]}["R6"] == "not shown"


def test_the_board_reads_verdicts_flights_and_what_is_not_covered(assured, evidence):
    text = (assured / artifacts.BOARD_PAGE).read_text(encoding="utf-8")
    check_policy(text)
    check_references(text)
    assert not re.search(r"<script|<link|src=|https?:", text)
    sections = {"conditions", "verdicts", "flights", "worst", "rules", "uncovered", "decision"}
    assert sections <= set(re.findall(r'<section id="(\w+)"', text))
    words = html.unescape(" ".join(re.sub("<[^>]*>", " ", text).split()))
    num_open = sum(entry["verdict"] != "shown" for entry in evidence["requirements"])
    total = len(evidence["requirements"])
    assert re.search(
        rf"for the board {total - num_open} of {total} requirements (is|are) shown, {num_open} ", words
    )
    for entry in evidence["requirements"]:
        assert entry["text"].rstrip(".") in words
        if entry["verdict"] != "shown":
            assert f"{entry['id']} {entry['title']} is {entry['verdict']}." in words
    assert "Flights longer than 3,600 s, starts other than at 50 to 100 m and at rest." in words
    systems = serialize.load(conf_folder() / "controller" / "champion_any_sun.yaml").systems
    assert f"{sum(len(system.rules) for system in systems)} rules do not fit on a sheet" in words
    hashes = evidence["controller"]["sha256"], evidence["config_hash"], evidence["sources"]
    assert all(each in words for each in hashes)
    assert "200 m R2" in words  # the limit that one page once lacked
    assert "15 m R1" in words


#: orbits of cases, of one and three quarters to seven hours
ORBITS = "+dispersions.orbit.mean_motion_rad_s={kind:uniform,low:0.00025,high:0.001}"


def test_a_board_follows_each_case_in_the_orbit_that_it_has_drawn():
    words = "+experiment=assure", "controller=champion_27", "sun=random", "duration_s=600", ORBITS
    experiment = compose_experiment(words).experiment
    mission, scenarios = experiment.mission, evaluation_scenarios(experiment)[:5]
    tracks, facts = Campaign(mission, load(experiment.controller, mission)).tracks(scenarios)
    flights = flights_of_board(facts, tracks, 5)
    for scenario, track, distances in zip(scenarios, tracks, flights.after_m, strict=True):
        rate = mission_of_case(mission, scenario).orbit.mean_motion_rad_s
        followed = linear(rate, track[-1, :6].astype(np.float64), flights.after_s)
        np.testing.assert_allclose(distances, followed, rtol=1e-6)


def test_a_worst_flight_is_judged_again_and_drawn_by_what_its_case_has_drawn(tmp_path, monkeypatch):
    drawn = ORBITS, "+dispersions.deputy.max_distance_m={kind:uniform,low:150,high:190}"
    words = "+experiment=assure", "controller=champion_27", "sun=random", "duration_s=600", *drawn
    job = compose_experiment(words)
    experiment, mission = job.experiment, job.experiment.mission
    controller, (scenario, *_) = load(experiment.controller, mission), evaluation_scenarios(experiment)
    requirement = load_requirements("inspection", mission)[7]
    (result,) = Campaign(mission, controller).judge([scenario], [requirement]).values()
    recorder = FlightRecorder(experiment, controller, job.config)
    judged = (*result.worst, scenario, "case 0")
    worst = record_worst(tmp_path, mission, recorder, None, requirement, judged)  # refuses another margin
    assert worst["recorded_margin"] == pytest.approx(worst["margin"], abs=0.05)
    missions = []

    def keep(track, num_points, mission, dots_per_inch):
        missions.append(mission)
        return draw_flight(track, num_points, mission, dots_per_inch)

    monkeypatch.setattr(worst_flight, "draw_flight", keep)
    entry = {"id": "R8", "title": "", "severity": "critical", "verdict": "refuted", "worst": worst}
    monkeypatch.setattr(worst_flight, "gravest", lambda _: entry)
    assert worst_flight.worst_drawn(experiment, tmp_path, {"requirements": [entry]})
    assert missions == [mission_of_case(mission, scenario)]


def test_every_distance_that_a_requirement_names_is_a_line(evidence):
    named = {
        float(value): entry["id"]
        for entry in evidence["requirements"]
        for value in re.findall(
            r"(?:distance|farthest)(?:\[\d+\])? [<>]=? ([\d.]+) m", entry["formula"] or ""
        )
    }
    limits = limits_of(evidence["requirements"])
    assert [limit.value_m for limit in limits] == sorted(named)
    assert all(named[limit.value_m] in limit.names for limit in limits)


@pytest.mark.parametrize("formula", ["", "always (coasting_distance <= 200 m)"])
def test_what_follows_the_end_is_told_where_no_requirement_is_about_it(evidence, formula):
    # all flights end at 75 m, at 0.1 m/s outwards along the track: beyond 200 m within half an hour
    track = np.tile([0.0, 75.0, 0.0, 0.0, 0.1, 0.0], (200, 361, 1))
    flights = flights_of_board(facts_of(Mission()), track, 200)
    others = [each for each in evidence["requirements"] if "coasting" not in (each["formula"] or "")]
    further = {**evidence["requirements"][0], "id": "R99", "formula": formula}
    shown = {**evidence, "requirements": [*others, further]}
    text = render_board(shown, (), flights, None, date(2026, 1, 2))
    sentence = "without a further push 100 % of these flights are beyond 200 m within 30 min"
    assert (sentence in text) == (not formula)


@pytest.mark.parametrize("name", ["champion_27", "champion_docking"])
def test_the_page_of_the_flagship_is_printed_on_two_sheets_with_all_its_rules(evidence, opened, name):
    systems = serialize.load(conf_folder() / "controller" / f"{name}.yaml").systems
    track = np.linspace([-70.0, 5.0, 3.0, *[0.1] * 12], [20.0, 60.0, 3.0, *[0.0] * 12], 361)
    flight = draw_flight(track, 99, Mission(), 50)
    flights = flights_of_board(facts_of(Mission()), np.repeat(track[np.newaxis], 200, axis=0), 200)
    text = render_board(evidence, systems, flights, ("Its words.", flight), date(2026, 1, 2), "hill")
    # grids: each force is scikit-fuzzy's at the rule's own values
    shown = [
        [float(value) for value in re.findall(r"<b>([+\-]?[\d.]+) N</b>", part)]
        for part in text.replace("−", "-").split('<div class="grid">')[1:]
    ]
    for system, forces in zip(systems, shown, strict=True):
        peaks = [[term.membership.peak for term in each.terms] for each in system.inputs]
        names, expected = [each.name for each in system.inputs], []
        for point in product(*peaks):
            simulation = build_simulation(system)
            simulation.inputs(dict(zip(names, point, strict=True)))
            simulation.compute()
            expected.append(simulation.output[system.outputs[0].name])
        np.testing.assert_allclose(forces, expected, rtol=5e-3, atol=1e-6)
    printed = opened(text).pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) == 2
    assert "2 January 2026" in text


#: by day each of both
SHOWN = night.by_day([(1280, "light"), (1280, "dark"), (390, "dark"), (390, "light")], 2)


@pytest.mark.parametrize(("width", "scheme"), SHOWN)
@pytest.mark.parametrize("name", [artifacts.EVIDENCE_PAGE, artifacts.BOARD_PAGE])
def test_axe_finds_nothing_serious_on_the_pages(assured, opened, axe, width, scheme, name):
    text = (assured / name).read_text(encoding="utf-8")
    assert serious_violations(opened(text, width=width, color_scheme=scheme), axe) == []


WATCHED = """schema: requirements
schema_version: 2
name: watched
requirements:
  - id: W1
    title: Stay near
    text: The deputy stays within 90 m.
    consequence: an example
    severity: marginal
    reason: About half of the coasting flights do.
    source: an example
    verified_by: [cases]
    formula: always (distance <= 90 m)
    probability: 0.2
    confidence: 0.9
"""


def test_flights_end_at_a_width_whatever_the_parts(tmp_path, monkeypatch, ran):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "watched.yaml").write_text(WATCHED)
    words = ["+experiment=assure", "controller=coast", "safety=none", "duration_s=300", "sun=random"]
    words += ["assurance.requirements=watched.yaml", "assurance.num_cases=4000"]
    shown = {}
    ways = {"wide": (0.1,), "cut": (None, "engine.part_cases=300"), "narrow": (0.07,)}
    for name, (given, *parts) in ways.items():
        # the width at which the first flights ended, and a hair: those of any other confidence go on
        at_most = shown["wide"]["high"] - shown["wide"]["low"] + 1e-12 if given is None else given
        folder, width = tmp_path / name / "run", f"assurance.stop_width={at_most!r}"
        printed = ran(*words, width, *parts, f"hydra.run.dir={folder}").err
        (entry,) = artifacts.read_json(folder, artifacts.EVIDENCE)["requirements"]
        shown[name] = entry["cases"]
        conditions = artifacts.read_json(folder, artifacts.EVIDENCE)["conditions"]
        flown = pq.read_table(folder / artifacts.ASSURED_CASES).num_rows
        assert conditions["num_cases"] == entry["cases"]["num_cases"] == flown
        assert entry["cases"]["high"] - entry["cases"]["low"] <= at_most == conditions["stop_width"]
        assert f"{flown:,} cases flown and judged" in printed
        assert "  stopped; assurance.stop_width is" in printed
        assert entry["verdict"] == "shown"
        assert "for any number of flights" in (folder / artifacts.EVIDENCE_PAGE).read_text(encoding="utf-8")
    assert shown["wide"] == shown["cut"]
    assert shown["narrow"]["num_cases"] > shown["wide"]["num_cases"]
    # the same seed goes on: no other try
    assert [each["num_tries"] for each in shown.values()] == [0, 0, 0]
    other = tmp_path / "other"
    ran(*words, "seed=9", "assurance.stop_width=0.1", f"hydra.run.dir={other}")
    (entry,) = artifacts.read_json(other, artifacts.EVIDENCE)["requirements"]
    assert (entry["cases"]["num_tries"], entry["cases"]["num_known"]) == (1, 0)
    assert entry["cases"]["confidence"] == pytest.approx(0.975)


def test_the_board_reads_of_each_motion_in_words():
    assert set(MOTION) == {kind.model for kind in variants_of(Dynamics)}
