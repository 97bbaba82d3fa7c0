"""The report of runs: one file, complete, true to its sources, honest about what is missing."""

import re
import shutil
from dataclasses import replace
from importlib.resources import files
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.image import imread

import telemetry
from fis_tools.formats import serialize
from fis_tools.render.theme import contrast
from fis_tools.review import page as review
from fis_tools.words.text import summary
from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.comparison import PAPER_NAME
from pipeline.evaluation.monte_carlo import SUCCESS, fly_cases, summarise
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.fly.simulation import fly_logged
from pipeline.report import pictures
from pipeline.report.contents import command_of, gather, read_evaluation, tracks_of
from pipeline.report.facts import facts_of
from pipeline.report.figures.flights import controls
from pipeline.report.page import write
from pipeline.report.pictures import draw
from pipeline.report.played import player_of_run
from pipeline.run import artifacts, manifests, tables
from pipeline.run.artifacts import ArtifactError
from pipeline.run.writing import write_json
from pipeline.scenarios import training_scenarios
from pipeline.settings.experiment import Mission
from telemetry.file.topics import fis_topic
from tests.browser import assert_tables_fit
from tests.pipeline.report.runs import HOSTILE, SECTIONS, page_of, run_of, small_controller, write_training
from tests.pipeline.stages.cases import carried_out
from tests.places import PROJECT
from tests.policies import Page, check_policy, check_references

#: with limits that some of the flights keep and others do not
TRAIN = ("+experiment=train_paper", "inspection_threshold_percent=30", "deputy.max_distance_m=120")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run with everything but recordings: folder, experiment, page."""
    folder = tmp_path_factory.mktemp("runs") / "trained"
    folder.mkdir()
    write_training(folder)
    experiment = run_of(folder, ("scenario", "evaluate"), *TRAIN)
    text = page_of(experiment, folder)
    return folder, experiment, text, Page(text)


@pytest.fixture
def copied(trained, tmp_path):
    """A copy of the run, for what changes it, and its experiment."""
    return Path(shutil.copytree(trained[0], tmp_path / "copied")), trained[1]


def words_of(page, section):
    return " ".join(page.text[section].split())


@pytest.mark.slow
def test_all_sections_are_there_with_their_pictures(trained):
    folder, experiment, text, page = trained
    check_policy(text)
    check_references(text)
    # the only address is the name of a vocabulary of XML, by which the script makes drawings
    assert "http" not in text.replace("http-equiv", "").replace('"http://www.w3.org/2000/svg"', "")
    assert [section["id"] for section in page.all("section") if section.get("id")] == list(SECTIONS)
    names = {f"trajectories-{kind}" for kind in ("training", "evaluation")}
    names |= {"control-training-0", "distributions", "convergence"}
    assert {path.stem for path in (folder / artifacts.FIGURES).iterdir()} == names
    assert {figure["id"] for figure in page.all("figure")} == {f"figure-{name}" for name in names}
    for svg in page.all("svg"):
        assert svg["role"] == "img"
        assert len(svg["aria-label"]) > 10
    assert [name for name, words in page.text.items() if "This run has no" in words] == ["recordings"]
    # they have the resolution that was asked for, and are not blank
    pixels = {path.stem: imread(path)[..., :3] for path in (folder / artifacts.FIGURES).iterdir()}
    assert all(picture.std() > 0.02 for picture in pixels.values())
    assert pixels["trajectories-training"].shape[:2] == (8.0 * experiment.report.dots_per_inch, 384)


@pytest.mark.slow
def test_no_column_of_a_report_is_hidden_at_any_width(trained, opened):
    page = opened(trained[2])
    assert page.locator("table").count() >= 4
    assert_tables_fit(page)


@pytest.mark.slow
def test_numbers_are_those_of_the_summary(trained, copied):
    folder, experiment, text, page = trained
    summary = artifacts.read_json(folder, artifacts.SUMMARY)
    contents = gather(experiment, folder)
    episodes, _ = fly_cases(experiment.mission, contents.controller, training_scenarios(experiment))
    # in ten minutes not all points are lit
    metrics = ("delta_v_m_s", "inspection_rate_percent", "inspectable_rate_percent", "mean_distance_m")
    success, violated = episodes["success"], episodes["violated"]
    trained_shares = [np.mean(share) for share in (success, violated, success & ~violated)]
    expected = [*(np.mean(episodes[name]) for name in metrics), *trained_shares]
    shares = [summary[name]["fraction"] for name in ("success", "violated", "success_and_within_limits")]
    expected += [*(summary[name]["mean"] for name in metrics), *shares]
    values = [float(value) for value in re.findall(r'<data value="([^"]+)">', text)]
    np.testing.assert_allclose(values, expected, rtol=1e-12)
    assert len({0.0, 1.0, *shares}) == 5, "the shares must differ for this test to see them exchanged"
    words = words_of(page, "summary")
    assert f"{100 * shares[2]:.1f} % of the flights reach 30 % inside the limits" in words
    assert f"{summary['violated']['count']} leave the permitted 15 to 120 m" in words
    for share in shares:
        assert f"{100 * share:.1f} %" in words
    rate = summary["inspection_rate_percent"]
    assert f"{rate['mean']:.2f} ± {rate['standard_deviation']:.2f}" in text
    assert f"{rate['low']:.2f} to {rate['high']:.2f}" in text
    # a summary is made from the episodes where it is missing
    (copied[0] / artifacts.SUMMARY).unlink()
    again = page_of(experiment, copied[0])
    assert [float(value) for value in re.findall(r'<data value="([^"]+)">', again)] == values


@pytest.mark.slow
def test_the_papers_results_stand_beside_flights_of_its_mission_alone(trained, copied):
    _, experiment, text, _ = trained
    assert not re.search(r"[Pp]aper(,| 5|'s)|The paper", re.sub(r"<style>.*?</style>", "", text, flags=re.S))
    papers = page_of(replace(experiment, mission=Mission()), copied[0])
    values = re.findall(r'<data value="([^"]+)">', papers)
    # seven of ours, each followed by what the paper tells
    assert (values[7:10], values[17:20]) == (["4.799", "99.748", "67.03"], ["5.62", "96.667", "66.629"])
    words = words_of(Page(papers), "summary")
    for stated in ("5.62 ± 0.715", "4.799 ± 0.458", "paper 5.62 m/s", f"The paper ({PAPER_NAME}) states"):
        assert stated in words
    assert "the dashed one the paper's" in words_of(Page(papers), "distributions")


@pytest.mark.slow
def test_the_controller_is_reviewed_on_a_page_of_its_own(trained):
    folder, experiment, _, page = trained
    champion = serialize.load(folder / artifacts.CHAMPION)
    assert artifacts.REVIEW in [link.get("href") for link in page.all("a")]
    for system in champion.systems:
        assert summary(system) in page.text["controller"]
    panel = player_of_run(gather(experiment, folder))
    assert (folder / artifacts.REVIEW).read_text() == review.write(champion, panel=panel)


@pytest.mark.slow
def test_the_review_is_along_the_recorded_flights_and_goes_with_its_controller(tmp_path):
    overrides = ("+experiment=fly", "controller=file", f"controller.path={small_controller(tmp_path)}")
    experiment = run_of(tmp_path, ("record", "report"), *overrides)
    path = tmp_path / artifacts.REVIEW
    recordings = sorted((tmp_path / artifacts.RECORDINGS).glob("*.mcap"))
    assert "along the flight" in path.read_text()
    panel = player_of_run(gather(experiment, tmp_path))
    one_axis = serialize.load(tmp_path / "one_axis.json")
    assert path.read_text() == review.write(one_axis, recordings, panel=panel)
    (tmp_path / artifacts.CONTROLLER).unlink()
    run_of(tmp_path, ("report",), "+experiment=fly", "controller=coast")
    assert not path.exists()


@pytest.mark.slow
def test_a_review_says_where_it_counts_but_what_was_fired(tmp_path):
    run_of(tmp_path, ("record",), "+experiment=fly", "controller=champion_27")
    (path,) = (tmp_path / artifacts.RECORDINGS).iterdir()
    recording = telemetry.read(path)
    made, fired = (
        max(map(count, recording.fis_names))
        for count in (
            lambda name: len(recording[fis_topic(name)]),
            lambda name: len(recording.fired(name)[0]),
        )
    )
    assert fired < made
    controller = serialize.load(PROJECT / "conf" / "controller" / "champion_27.yaml")
    text, of_all = (review.write(controller, [path], all_periods=each) for each in (False, True))
    assert f"({fired} inferences whose force was fired, of {made})" in text
    assert f"({made} inferences)" in of_all
    assert ("met where fired" in text, "met where fired" in of_all) == (True, False)


def test_text_stands_out_from_the_page_in_light_and_dark():
    style = (files("pipeline.report") / "templates" / "report.css").read_text(encoding="utf-8")
    for scheme in re.findall(r":root \{(.*?)\}", style, re.DOTALL)[:2]:
        colours = dict(re.findall(r"--(\w+): (#\w{6})", scheme))
        grounds = [ground for ground in ("paper", "panel", "band") if ground in colours]
        for name, ground in product(("ink", "muted", "accent"), grounds):
            assert contrast(colours[name], colours[ground]) >= 4.5, (name, ground)


@pytest.mark.slow
def test_the_page_says_where_the_run_comes_from(trained):
    folder, experiment, _, page = trained
    manifest, words = manifests.read(folder), page.text["provenance"]
    assert folder.as_posix() not in words
    for sentence in (
        *(manifest["config_hash"], manifest["versions"]["numpy"], manifest["sha256"][artifacts.EPISODES]),
        *("python -m pipeline repeat RUN report", "python -m pipeline again RUN"),
        "command line of this run was not kept",
    ):
        assert sentence in words
    assert f"seed\n{experiment.seed}" in re.sub(r"\n+", "\n", words) or f"seed{experiment.seed}" in words


@pytest.mark.slow
@pytest.mark.parametrize(
    "missing",
    [
        {
            artifacts.TRAJECTORIES: ("evaluation", "trajectories.parquet; the stage evaluate writes it"),
            artifacts.LOGBOOK: ("convergence", "logbook.csv; the stage train writes it"),
            artifacts.MANIFEST: ("provenance", "manifest.json; python -m pipeline writes it"),
        },
        {
            artifacts.EPISODES: ("distributions", "episodes.parquet; the stage evaluate writes it"),
            artifacts.CHAMPION: ("controller", "champion.json; the stage train writes it"),
        },
    ],
)
def test_what_is_missing_is_left_out_with_a_sentence(trained, copied, missing):
    folder, experiment = copied
    for name in missing:
        (folder / name).unlink()
    page = Page(page_of(experiment, folder))
    for section, sentence in missing.values():
        assert sentence in words_of(page, section)
        assert "This run has no" not in trained[3].text[section]
    if artifacts.CHAMPION in missing:
        assert "the stage train the champion" in words_of(page, "training")
    stems = {path.stem for path in (folder / artifacts.FIGURES).iterdir()}
    assert {figure["id"] for figure in page.all("figure")} == {f"figure-{stem}" for stem in stems}


@pytest.mark.slow
def test_the_report_of_the_same_run_is_the_same_and_stale_pictures_go(trained, copied, capsys):
    folder, experiment = copied
    drawn, other = (folder / artifacts.FIGURES / name for name in ("control-start.png", "mine.png"))
    for path in (drawn, other):
        path.write_bytes(b"")
    assert page_of(experiment, folder) == trained[2]
    assert "pictures" in capsys.readouterr().err
    assert not drawn.exists()
    assert other.exists()


@pytest.mark.slow
def test_an_evaluated_controller_shows_its_median_flight(tmp_path):
    controller = ("controller=file", f"controller.path={small_controller(tmp_path)}")
    stages = ("scenario", "evaluate", "record", "report")
    # what a case draws besides its place: a velocity, a mass
    drawn = "monte_carlo.max_speed_m_s=0.2", "+dispersions.deputy.mass_kg={kind:uniform,low:6,high:18}"
    experiment = run_of(tmp_path, stages, "+experiment=evaluate", "sun=random", *controller, *drawn)
    page = Page((tmp_path / artifacts.REPORT).read_text())
    (median,) = (path.stem for path in (tmp_path / artifacts.RECORDINGS).glob("median-*.mcap"))
    assert (tmp_path / artifacts.FIGURES / f"control-{median}.png").exists()
    assert f"Case {median.split('-')[-1]}, the median" in page.text["control"]
    assert f"{artifacts.RECORDINGS}/{median}.mcap" in page.text["recordings"]
    assert "the stage scenario writes the starts" in page.text["training"]
    assert "Sun random" in page.text["summary"]
    spent = tables.read_parquet(tmp_path, artifacts.EPISODES)["delta_v_m_s"][int(median.split("-")[-1])]
    (shown,) = gather(experiment, tmp_path).shown
    assert shown.log.delta_v_m_s[-1] == spent
    words = words_of(page, "distributions")
    summary = artifacts.read_json(tmp_path, artifacts.SUMMARY)
    of_mass, nominal = summary["sensitivity"][0]["delta_v_m_s"], summary["nominal"]["delta_v_m_s"]
    assert of_mass["value"] < -0.3
    assert f"deputy.mass_kg−{-of_mass['value']:.2f} (" in words
    assert f"without dispersions{nominal['mean']:.3f} ± {nominal['standard_deviation']:.3f}" in words
    seen, ended = (summary["nominal"][name] for name in ("inspectable_rate_percent", SUCCESS))
    of_nominal = f"{seen['mean']:.2f} ± {seen['standard_deviation']:.2f}{100.0 * ended['fraction']:.1f} %"
    assert of_nominal in words
    middle = summary["percentiles"]["delta_v_m_s"][0]
    assert f"50 % have at most{middle['value']:.3f}{middle['low']:.3f} to {middle['high']:.3f}" in words
    rate, count = summary["inspectable_rate_percent"]["mean"], summary["inspectable_count"]["mean"]
    printed = words_of(page, "summary")
    assert f" {rate:.2f} ± " in printed
    assert f"% of the {count:.1f} a flight that can be inspected" in printed
    del summary["nominal"]["success_and_within_limits"]
    write_json(tmp_path / artifacts.SUMMARY, summary)
    with pytest.raises(ArtifactError, match=r"dispersions what it should .* repeat the stage evaluate"):
        page_of(experiment, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "spent"),
    [
        (("controller=champion_27",), "spends {:.3f} m/s and inspects"),
        (("controller=champion_docking", "problem=docking"), "and spend {:.3f} m/s"),
        (("controller=champion_27", "fleet.deputies=2"), "spends {:.3f} m/s in total and inspects"),
    ],
    ids=lambda words: words[-1] if isinstance(words, tuple) else "",
)
def test_an_evaluation_of_a_single_case_has_no_spread(tmp_path, words, spent):
    overrides = "+experiment=evaluate", "monte_carlo.num_cases=1", "duration_s=600", *words
    experiment = carried_out(compose_experiment(list(overrides)), tmp_path, "scenario", "evaluate").experiment
    text = "".join(data for _, data in Page(page_of(experiment, tmp_path)).texts)
    fuel = artifacts.read_json(tmp_path, artifacts.SUMMARY)["delta_v_m_s"]
    assert (fuel["standard_deviation"], fuel["low"], fuel["high"]) == (None, None, None)
    assert spent.format(fuel["mean"]) in " ".join(text.split())


@pytest.mark.slow
def test_one_flight_is_reported_alone(tmp_path):
    overrides = ("+experiment=fly", "controller=coast", "stages=[record,report]")
    experiment = run_of(tmp_path, ("record", "report"), *overrides)
    page = Page((tmp_path / artifacts.REPORT).read_text())
    contents = gather(experiment, tmp_path)
    (flight,) = contents.shown
    log = fly_logged(experiment.mission, contents.controller, flight.scenario)
    seen, most = log.is_inspected[-1].sum(), log.is_inspectable.sum()
    assert f"inspects {seen} of the {most} points that can be inspected (99 in all)" in page.text["summary"]
    assert "The controller coast has no fuzzy systems." in page.text["controller"]
    figures = sorted(figure["id"] for figure in page.all("figure"))
    assert figures == ["figure-control-start", "figure-trajectories-start"]
    for section in ("training", "evaluation", "distributions", "convergence"):
        assert "This run has no" in page.text[section]
    first = (tmp_path / artifacts.REPORT).read_bytes()
    run_of(tmp_path, ("report",), *overrides)
    assert "report" in manifests.read(tmp_path)["finished_stages"]
    assert (tmp_path / artifacts.REPORT).read_bytes() == first


@pytest.mark.slow
def test_names_are_text_and_no_markup(trained):
    folder, experiment, _, _ = trained
    contents = gather(experiment, folder)
    (system,) = contents.controller.systems
    hostile = replace(contents.controller, name=HOSTILE, systems=(replace(system, name=HOSTILE),))
    hostile_run = replace(experiment, report=replace(experiment.report, title=HOSTILE))
    contents = replace(
        contents, controller=hostile, experiment=hostile_run, command=HOSTILE, config_text=HOSTILE
    )
    illustrations = {drawn.name: drawn for drawn in draw(contents)}
    assert all(re.fullmatch(r"[a-z0-9-]+", name) for name in illustrations)
    text = write(contents, illustrations, player_of_run(contents))
    page = Page(text)
    assert HOSTILE not in text
    assert len(page.all("script")) == bool(contents.shown)
    assert ("h1", HOSTILE) in page.texts
    assert page.text["controller"].count(HOSTILE) >= 2
    assert HOSTILE in page.text["provenance"]
    assert HOSTILE in page.text["summary"]


@pytest.mark.slow
@pytest.mark.parametrize("name", [artifacts.LOGBOOK, artifacts.SUMMARY, artifacts.EPISODES])
def test_a_damaged_file_is_refused_in_words(copied, name):
    folder, experiment = copied
    (folder / name).write_bytes(b"best\nno number\n")
    with pytest.raises(ArtifactError, match="repeat the stage"):
        page_of(experiment, folder)


def test_trajectories_are_sorted_into_their_cases_and_those_of_other_flights_refused():
    generator = np.random.default_rng(3)
    positions = generator.normal(size=(4, 5, 3)).astype(np.float32)
    rows = {"case": np.repeat([7, 2, 9, 4], 5), "sample": np.tile(np.arange(5), 4)}
    rows |= {f"position_{axis}_m": positions[:, :, i].ravel() for i, axis in enumerate("xyz")}
    mixed = generator.permutation(20)
    tracks = tracks_of({name: column[mixed] for name, column in rows.items()}, np.array([9, 2, 4, 7]))
    np.testing.assert_array_equal(tracks, positions[[2, 1, 3, 0]])
    for count in (9, 5):
        with pytest.raises(ArtifactError, match="different flights; repeat the stage evaluate"):
            tracks_of({name: column[:count] for name, column in rows.items()}, np.array([7, 2]))


@pytest.mark.parametrize(
    ("change", "missing"),
    [
        (lambda _: {}, "num_cases"),
        (lambda _: [], "num_cases"),
        (lambda whole: whole | {"violated": {}}, "violated.count"),
        (lambda whole: whole | {"success": 0.5}, "success.count"),
        (lambda whole: whole | {"delta_v_m_s": whole["delta_v_m_s"] | {"low": "none"}}, "delta_v_m_s.low"),
    ],
)
def test_a_summary_without_its_numbers_is_refused_in_words(tmp_path, change, missing):
    episodes = {name: np.array([1.0, 2.0]) for name in ("delta_v_m_s", "inspection_rate_percent")}
    episodes |= {"mean_distance_m": np.array([70.0, 71.0])}
    episodes |= {"success": np.array([True, False]), "violated": np.array([False, False])}
    whole = {"num_cases": 2, **summarise(episodes, 95.0)}
    write_json(tmp_path / artifacts.SUMMARY, whole)
    assert read_evaluation(tmp_path, 95.0).summary == whole
    write_json(tmp_path / artifacts.SUMMARY, change(whole))
    with pytest.raises(ArtifactError, match=rf"no number {re.escape(missing)},.*repeat the stage evaluate"):
        read_evaluation(tmp_path, 95.0)


def test_the_command_is_the_one_that_was_typed(tmp_path):
    assert command_of(tmp_path, {}) == ""
    words = ["+experiment=evaluate", "controller=file", "controller.path=a b.json", "hydra.run.dir=here"]
    expected = "python -m pipeline +experiment=evaluate controller=file 'controller.path=a b.json'"
    assert command_of(tmp_path, {"command": words}) == expected
    words = ["--config-dir", "/my conf", *words[:2], "controller.path='/a/b.json'"]
    expected = "python -m pipeline --config-dir '/my conf' +experiment=evaluate controller=/a/b.json"
    assert command_of(tmp_path, {"command": words}) == expected
    # a run from before manifests told it
    kept = tmp_path / ".hydra"
    kept.mkdir()
    (kept / "overrides.yaml").write_text(yaml.safe_dump(["+experiment=evaluate", "hydra.run.dir=here"]))
    assert command_of(tmp_path, {"seed": 1}) == "python -m pipeline +experiment=evaluate"
    sources = [{"path": "/ours", "provider": "main"}, {"path": "/my conf", "provider": "command-line"}]
    (kept / "hydra.yaml").write_text(yaml.safe_dump({"hydra": {"runtime": {"config_sources": sources}}}))
    assert command_of(tmp_path, {}) == "python -m pipeline --config-dir '/my conf' +experiment=evaluate"


@pytest.mark.slow
def test_training_flights_start_where_the_last_round_did(tmp_path):
    write_training(tmp_path)
    overrides = ("+experiment=train_paper", "starts=random", "starts.num_cases=3", "optimizer.rounds=2")
    experiment = run_of(tmp_path, ("scenario",), *overrides)
    contents = gather(experiment, tmp_path)
    assert contents.training_round == 2
    assert contents.shown[0].title == "Training case 0 of round 2"
    expected = training_scenarios(experiment, 1)
    np.testing.assert_array_equal(contents.shown[0].scenario.position_m, expected[0].position_m)
    xs = [scenario.position_m[0] for scenario in expected]
    np.testing.assert_array_equal(contents.training.episodes["position_x_m"], xs)
    # with one set of starts for all rounds, none is named
    kept = gather(run_of(tmp_path, ("scenario",), *overrides, "starts.redraw=false"), tmp_path)
    assert kept.training_round is None
    assert kept.shown[0].title == "Training case 0"


@pytest.mark.slow
def test_a_flight_is_shown_by_what_its_case_has_drawn(tmp_path, monkeypatch):
    drawn = (
        "+dispersions.inspection_threshold_percent={kind:uniform,low:20,high:30}",
        "+dispersions.deputy.max_distance_m={kind:uniform,low:150,high:190}",
    )
    words = ("+experiment=evaluate", "controller=champion_27", "telemetry.record_start=false", *drawn)
    experiment = run_of(tmp_path, ("evaluate",), *words)
    contents, missions = gather(experiment, tmp_path), []
    (flight,) = contents.shown
    of_case = mission_of_case(experiment.mission, flight.scenario)
    assert of_case.deputy.max_distance_m < experiment.mission.deputy.max_distance_m
    ((_, _, facts),) = facts_of(flight, experiment.mission)
    assert f"{of_case.inspection_threshold_percent:g} % reached" in dict(facts)

    def keep(log, mission):
        missions.append(mission)
        return controls(log, mission)

    monkeypatch.setattr(pictures, "controls", keep)
    draw(contents)
    assert missions == [of_case]
