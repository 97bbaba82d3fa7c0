"""The page of a report: what it says in words and tables, put into the template."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.document.html import policy, template
from fis_tools.words.text import summary
from pipeline.evaluation import comparison
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.flight.state.log import Scenario, inspectable_rate, points_in_words, points_needed
from pipeline.report import comparisons
from pipeline.report.contents import POSITION, Contents, FlightSet, ShownFlight
from pipeline.report.figures.style import MOST_POINTS, Illustration
from pipeline.run import artifacts
from pipeline.settings.experiment import Mission

#: metric of a summary: decimals on the page
DECIMALS = {"delta_v_m_s": 3, "inspection_rate_percent": 2, "mean_distance_m": 2}
INSPECTABLE = "inspectable_rate_percent"
SHARES = ("success", "violated", SUCCESS)
#: of many training flights only so many have a row of their own
MOST_ROWS = 64


@dataclass(frozen=True)
class Cell:
    """A number on the page: as it is shown, as it is, and what is said of it beneath."""

    shown: str
    value: float | None = None
    note: str = ""


@dataclass(frozen=True)
class SummaryRow:
    """A row of the summary."""

    label: str
    note: str
    cells: list[Cell]
    is_ours: bool


def write(contents: Contents, illustrations: Mapping[str, Illustration]) -> str:
    """Write the page.

    Parameters
    ----------
    contents : Contents
    illustrations : mapping of str to Illustration

    Returns
    -------
    str
        HTML that needs no other file, and leads to the review page beside it.
    """
    experiment, rows = contents.experiment, contents.comparison
    return template("pipeline.report", "templates", "report.html").render(
        policy=policy(),
        contents=contents,
        experiment=experiment,
        lead=lead(contents),
        safety=safety(contents),
        tiles=tiles(contents),
        rows=summary_rows(contents),
        confidence=f"{experiment.monte_carlo.confidence_percent:g}",
        limits=_limits(experiment.mission),
        threshold=f"{experiment.mission.inspection_threshold_percent:g}",
        start_name=next((flight.name for flight in contents.shown if flight.is_alone), "start"),
        flights=[(f"control-{f.name}", f.title, flight_facts(f, experiment.mission)) for f in contents.shown],
        sees_less=_sees_less(contents),
        cases=case_rows(contents.training),
        compared=comparison,
        comparison=comparisons.tables_of(rows),
        worlds=comparison.matrices(rows) if comparison.worlds_of(rows) else [],
        optimum_words=comparisons.optimum_in_words(
            contents.beside, experiment.mission.inspection_threshold_percent
        ),
        optimum_cases=comparisons.optimum_rows(contents.beside),
        has_crowd=bool(contents.training and contents.training.summary["num_cases"] > MOST_POINTS),
        summary=summary,
        illustrations=illustrations,
        provenance=_provenance(contents.manifest),
        files=_files(contents.manifest),
        artifacts=artifacts,
    )


def lead(contents: Contents) -> str:
    """Say in a sentence or two what came out."""
    mission = contents.experiment.mission
    who = f"The controller {contents.controller.name}" if contents.controller else "The controller"
    for _, flights, _ in contents.sets[-1:]:
        summary, starts = flights.summary, "random starts" if contents.evaluation else "training starts"
        delta_v, rate = summary["delta_v_m_s"], summary["inspection_rate_percent"]
        outside, of_these = summary["violated"]["count"], _inspectable_words(summary)
        sun = f" with the Sun {summary['sun']}" if "sun" in summary else ""
        leave = "none leaves" if not outside else "one leaves" if outside == 1 else f"{outside:,} leave"
        return (
            f"{who}, flown from {summary['num_cases']:,} {starts}{sun}, spends "
            f"{delta_v['mean']:.3f} ± {delta_v['standard_deviation']:.3f} m/s and inspects "
            f"{rate['mean']:.2f} ± {rate['standard_deviation']:.2f} % of the points{of_these}. "
            f"{100 * summary[SUCCESS]['fraction']:.1f} % of the flights reach "
            f"{mission.inspection_threshold_percent:g} % inside the limits; {leave} {_limits(mission)}."
        )
    if contents.shown:
        log = contents.shown[0].log
        return f"{who} inspects {points_in_words(log)} for {log.delta_v_m_s[-1]:.3f} m/s."
    if contents.comparison:
        flown = [row for row in contents.comparison if row.source == comparison.FLOWN]
        return (
            f"{len({row.controller for row in flown})} controllers, flown side by side from "
            f"{flown[0].num_cases:,} random starts each."
        )
    return "This run has no flights yet."


def _inspectable_words(summary: Mapping[str, Any]) -> str:
    """Say what the rate is of the points that can be inspected, where some cannot be."""
    if not can_see_less(summary):
        return ""
    count, rate = summary["inspectable_count"]["mean"], summary[INSPECTABLE]
    return (
        f", {rate['mean']:.2f} ± {rate['standard_deviation']:.2f} % of the {count:.1f} a flight that can be "
        "inspected, to which success refers"
    )


def can_see_less(flown: Mapping[str, Any]) -> bool:
    """Tell whether a summary is of flights in which some points could not be inspected."""
    return INSPECTABLE in flown and flown[INSPECTABLE]["mean"] != flown["inspection_rate_percent"]["mean"]


def _sees_less(contents: Contents) -> bool:
    return any(can_see_less(flights.summary) for _, flights, _ in contents.sets)


def safety(contents: Contents) -> list[str]:
    """Say, a sentence or two for each set of flights, what the safety layer did; nothing where it is off."""
    if contents.experiment.mission.safety.kind == "none":
        return []
    off = {"Evaluation": contents.without_safety}
    words = [
        comparisons.safety_words(word.lower(), flights.summary, off.get(word))
        for word, flights, _ in reversed(contents.sets)
    ]
    return [text for text in words if text]


def _limits(mission: Mission) -> str:
    return f"{mission.deputy.min_distance_m:g} to {mission.deputy.max_distance_m:g} m"


def tiles(contents: Contents) -> list[tuple[str, str, str, str]]:
    """Return the headline numbers: label, number, unit, and the paper's."""
    if not contents.sets:
        return []
    _, flights, reported = contents.sets[-1]
    summary = flights.summary
    means = (
        ("mean Δv", "delta_v_m_s", 2, "m/s"),
        ("mean inspection rate", "inspection_rate_percent", 1, "%"),
    )
    shares = (("successful flights", SUCCESS), ("flights outside the limits", "violated"))
    found = [
        (label, f"{summary[name]['mean']:.{places}f}", unit, f"paper {reported.means[name]:g} {unit}")
        for label, name, places, unit in means
    ]
    for label, name in shares:
        share = summary[name]
        beside = f"{share['count']:,} of {summary['num_cases']:,}"
        found.append((label, f"{100 * share['fraction']:.1f}", "%", beside))
    return [*found, *comparisons.times_tile(contents.beside)]


def summary_rows(contents: Contents) -> list[SummaryRow]:
    """Return the rows of the summary: ours, and the paper's under each."""
    rows = []
    for word, flights, reported in contents.sets:
        summary = flights.summary
        note = f"{summary['num_cases']:,} flights" + (f", Sun {summary['sun']}" if "sun" in summary else "")
        if flights is contents.training and contents.training_round:
            note += f", starts of round {contents.training_round}"
        cells = [*(_mean_cell(summary[name], places) for name, places in DECIMALS.items())]
        cells += [_share_cell(summary[name]) for name in SHARES]
        paper = _paper_row(reported)
        if _sees_less(contents):
            cells.insert(2, _mean_cell(summary[INSPECTABLE], 2))
            paper.cells.insert(2, Cell("not stated"))
        rows += [SummaryRow(word, note, cells, is_ours=True), paper]
    return rows


def _mean_cell(measure: Mapping[str, float], places: int) -> Cell:
    shown = f"{measure['mean']:.{places}f} ± {measure['standard_deviation']:.{places}f}"
    return Cell(shown, measure["mean"], f"{measure['low']:.{places}f} to {measure['high']:.{places}f}")


def _share_cell(measure: Mapping[str, float]) -> Cell:
    note = f"{100 * measure['low']:.1f} to {100 * measure['high']:.1f} %"
    return Cell(f"{100 * measure['fraction']:.1f} %", measure["fraction"], note)


def _paper_row(reported: comparison.Reported) -> SummaryRow:
    cells = [
        Cell(f"{reported.means[name]:g} ± {reported.standard_deviations[name]:g}", reported.means[name])
        for name in DECIMALS
    ]
    cells += [Cell("not stated") for _ in SHARES]
    note = f"{reported.num_cases:,} flights, Sun not stated"
    return SummaryRow(f"Paper, {reported.label}", note, cells, is_ours=False)


def flight_facts(flight: ShownFlight, mission: Mission) -> list[tuple[str, str]]:
    """Return what is to be known of a flight besides its pictures: names and values."""
    log = flight.log
    counts = log.is_inspected.sum(axis=1)
    inspectable = int(log.is_inspectable.sum())
    needed = points_needed(inspectable, mission.inspection_threshold_percent)
    reached = np.flatnonzero(counts >= needed)
    distances = np.linalg.norm(log.position_m, axis=1)
    start = ", ".join(_signed(component, 2) for component in flight.scenario.position_m)
    return [
        ("start, Hill axes", f"({start}) m"),
        ("Sun at the start", _sun_in_words(flight.scenario)),
        ("Δv", f"{log.delta_v_m_s[-1]:.3f} m/s"),
        ("inspected", f"{points_in_words(log)}, {inspectable_rate(counts[-1], inspectable):.2f} %"),
        (
            f"{mission.inspection_threshold_percent:g} % reached",
            f"after {reached[0] * mission.control_period_s:g} s" if reached.size else "not in this flight",
        ),
        (
            "distance",
            f"{distances.min():.1f} to {distances.max():.1f} m, {distances.mean():.1f} m in the mean",
        ),
    ]


def _sun_in_words(scenario: Scenario) -> str:
    angle, elevation = math.degrees(scenario.sun_angle_rad), math.degrees(scenario.sun_elevation_rad)
    return f"{angle:.1f}°" + (f", {_signed(elevation, 1)}° over the orbit plane" if elevation else "")


def case_rows(training: FlightSet | None) -> list[list[str]]:
    """Return one row of words for each training flight, none where they are too many."""
    if training is None or training.episodes is None or len(training.episodes["case"]) > MOST_ROWS:
        return []
    episodes = training.episodes
    return [
        [
            str(int(episodes["case"][row])),
            ", ".join(_signed(episodes[name][row], 1) for name in POSITION),
            f"{math.degrees(episodes['sun_angle_rad'][row]):.1f}",
            f"{episodes['delta_v_m_s'][row]:.3f}",
            f"{episodes['inspection_rate_percent'][row]:.2f}",
            f"{episodes['mean_distance_m'][row]:.2f}",
            f"{episodes['min_distance_m'][row]:.1f} to {episodes['max_distance_m'][row]:.1f}",
            comparisons.outcome(bool(episodes["success"][row]), bool(episodes["violated"][row])),
        ]
        for row in range(len(episodes["case"]))
    ]


def _signed(value: float, places: int) -> str:
    """Write a number with a true minus sign."""
    return f"{value:.{places}f}".replace("-", "−")


def _provenance(manifest: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if manifest is None:
        return []
    # an earlier report is replaced by this one: a repeated page must not differ for it
    finished = [name for name in manifest["finished_stages"] if name != "report"]
    return [
        ("configuration, SHA-256", str(manifest["config_hash"])),
        ("seed", str(manifest["seed"])),
        ("revision of the sources", str(manifest.get("git_revision", "not in a repository"))),
        ("stages finished before this page", ", ".join(finished) or "none"),
    ]


def _files(manifest: Mapping[str, Any] | None) -> dict[str, str]:
    """Return the files that the report is made from, and their hashes."""
    return {
        name: digest
        for name, digest in (manifest or {}).get("sha256", {}).items()
        if artifacts.stage_of(name) != "report"
    }
