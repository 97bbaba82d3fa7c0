"""The mission beside the editor: a thousand flights for every touch of a controller, and their panels."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from markupsafe import Markup
from nicegui import ui

from fis_tools.document import Cell, Document, Mark, Table, html
from fis_tools.edit.panels import ENTERED, Panel, Show, document, tell
from fis_tools.edit.shown import Options, axis, chart, dots, draw, line
from fis_tools.findings.explanation import explain
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import REASONS
from fis_tools.processors import num_processors
from fis_tools.words.text import number, sentence
from pipeline.array_types import Floats, Integers
from pipeline.evaluation.assurance.campaign import FormulaResult, concatenate, evaluate_formulas
from pipeline.evaluation.assurance.quantities import PointCounts
from pipeline.evaluation.assurance.requirements import CASES, Requirement, verified_by_method
from pipeline.evaluation.assurance.verdicts import Evidence, judge, verdict
from pipeline.evaluation.monte_carlo import episode_columns, fly_tracked
from pipeline.evaluation.statistics import Column, Compared, compare, succeeds
from pipeline.flight.control.controller import Controller, from_fuzzy
from pipeline.flight.control.law import law_of
from pipeline.flight.goals.flights import fly_logged
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import AXES
from pipeline.flight.world.pack import inspection_points
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Experiment
from pipeline.threads import in_threads

#: cases of a first answer, and of each that follows
FIRST, NEXT = 100, 300


@dataclass(frozen=True, eq=False)
class Flown:
    """Some first cases, flown by one controller.

    Parameters
    ----------
    episodes : dict of (n,) arrays
        As an evaluation writes them.
    outcomes : dict of str to FormulaResult
        By the ids of requirements.
    """

    episodes: dict[str, Column]
    outcomes: dict[str, FormulaResult]

    def verdicts(self, requirements: Sequence[Requirement]) -> list[tuple[Requirement, str, str]]:
        """Return each requirement with its verdict in a word, and why."""
        judged = []
        for requirement in requirements:
            outcome = self.outcomes[requirement.id]
            claim = requirement.probability, requirement.confidence
            judgement = judge(outcome.margins, outcome.is_met, *claim, outcome.num_occurred)
            result = verdict(Evidence(requirement, judgement))
            failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} fail"
            judged.append((requirement, result.word, f"{failed}; {result.why}"))
        return judged


class EditorCases:
    """The cases of an experiment.

    Parameters
    ----------
    experiment : Experiment
    requirements : sequence of Requirement
        Those that are verified by cases are judged.
    """

    def __init__(self, experiment: Experiment, requirements: Sequence[Requirement]) -> None:
        self.mission, self._settings = experiment.mission, experiment.monte_carlo
        self._threads = experiment.monte_carlo.workers or num_processors()
        self.requirements = verified_by_method(requirements, CASES)
        self._formulas = {
            requirement.id: requirement.formula
            for requirement in self.requirements
            if requirement.formula is not None
        }
        self.scenarios = evaluation_scenarios(experiment)

    def fly(self, fuzzy: FuzzyController) -> Iterator[Flown]:
        """Fly the first cases, then more, then all; what is yielded holds those before it.

        Raises
        ------
        pipeline.flight.control.controller.ControllerError
            If the controller cannot fly.
        """
        controller = self.ready(fuzzy)
        flown: list[Flown] = []
        ends = [*range(FIRST, len(self.scenarios), NEXT), len(self.scenarios)]
        for start, end in pairwise([0, *ends]):
            shares = np.array_split(np.arange(start, end), self._threads)
            flown += in_threads(partial(self._share, controller), filter(len, shares), workers=self._threads)
            yield _joined(flown)

    def ready(self, fuzzy: FuzzyController) -> Controller:
        """Return a controller as it flies.

        Raises
        ------
        pipeline.flight.control.controller.ControllerError
            If it cannot fly.
        """
        controller = from_fuzzy(fuzzy)
        law_of(controller, self.mission)
        return controller

    def _share(self, controller: Controller, cases: Integers) -> Flown:
        """Fly and judge some cases in one thread."""
        scenarios = [self.scenarios[case] for case in cases]
        outcomes, tracks = fly_tracked(self.mission, controller, scenarios, workers=1)
        points = PointCounts(len(inspection_points(self.mission)), outcomes.inspectable_count)
        evaluated = evaluate_formulas(tracks, points, self._formulas, self.mission.control_period_s)
        return Flown(episode_columns(self.mission, scenarios, outcomes) | {"case": cases}, evaluated)

    def compare(self, before: Flown, after: Flown) -> list[Compared]:
        """Compare two controllers on their common cases, see `pipeline.evaluation.statistics.compare`."""
        return compare(before.episodes, after.episodes, self._settings.confidence_percent)

    def log(self, fuzzy: FuzzyController, case: int) -> FlightLog:
        """Fly a case and log it."""
        return fly_logged(self.mission, self.ready(fuzzy), self.scenarios[case])


def _joined(parts: Sequence[Flown]) -> Flown:
    episodes = {name: np.concatenate([part.episodes[name] for part in parts]) for name in parts[0].episodes}
    outcomes = {name: concatenate([part.outcomes[name] for part in parts]) for name in parts[0].outcomes}
    return Flown(episodes, outcomes)


def most_changed(before: Flown, after: Flown, count: int) -> Integers:
    """Return the cases that changed most: in success, then in points, then in delta-v."""
    ends = succeeds(before.episodes) != succeeds(after.episodes)
    points = np.abs(after.episodes["inspected_count"] - before.episodes["inspected_count"])
    spent = np.abs(after.episodes["delta_v_m_s"] - before.episodes["delta_v_m_s"])
    return np.lexsort((-spent, -points, ~ends))[:count]


#: bins of the histogram at most, and from one label to the next; flights that changed most, as shown
BINS, LABELLED, MOST = 40, 5, 6
OPENED, NOW = "as opened", "now"
BEFORE, AFTER, SEEN, MISSED, INK = "#9aa4ae", "#1f5fa8", "#3f7d3a", "#a02018", "#1b1f24"
AXIS_COLOURS = ("#be5014", AFTER, SEEN)
REASON_WORDS = tuple(REASONS.values())


class ManyFlights(Panel):
    """What all cases came to, beside those of the controller that was opened.

    Parameters
    ----------
    cases : Cases
    original : FuzzyController
    choose : callable
        Shows a case alone.
    """

    title = "Flights"

    def __init__(self, cases: EditorCases, original: FuzzyController, choose: Callable[[int], None]) -> None:
        self._cases, self._original, self._choose = cases, original, choose
        self._before: list[Flown] = []

    def build(self, again: Callable[[], None]) -> None:
        """Put tables and a histogram on the page."""
        self._numbers = document().props('role="status"')
        self._chart = ui.echart({"series": []}).classes("histogram")
        self._below = document()
        pressed = "(event) => event.target.dataset.case && emit(Number(event.target.dataset.case))"
        self._below.on("click", lambda event: self._choose(event.args), js_handler=pressed)

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Fly some, then all."""
        if not self._before:
            self._before = list(self._cases.fly(self._original))
        try:
            for before, after in zip(self._before, self._cases.fly(controller), strict=True):
                # parts that are not shown let a touch come between
                is_shown = before in (self._before[0], self._before[-1])
                yield self._summary(controller, before, after) if is_shown else lambda: None
        except ValueError as refused:
            yield partial(tell, self._numbers, innerHTML=html.element("p", str(refused), class_="worse"))

    def _summary(self, controller: FuzzyController, before: Flown, after: Flown) -> Show:
        numbers = html.body(Document([_numbers(self._cases.compare(before, after))]))
        below = html.body(Document([_judged(after.verdicts(self._cases.requirements))]))
        if controller != self._original:
            below = _changed_most(before, after) + below
        return partial(self._show, str(numbers), str(below), _histogram(before, after))

    def _show(self, numbers: str, below: str, bars: Options) -> None:
        tell(self._numbers, innerHTML=numbers)
        tell(self._below, innerHTML=below)
        draw(self._chart, bars)


def _judged(verdicts: Sequence[tuple[Requirement, str, str]]) -> Table:
    rows: list[list[Cell]] = [
        [f"{requirement.id} {requirement.title}", Mark(word, word.replace(" ", "-"), note=why)]
        for requirement, word, why in verdicts
    ]
    return Table(["requirement", "verdict"], rows)


def _changed_most(before: Flown, after: Flown) -> Markup:
    """Return a button for each of the flights that changed most."""
    shown = []
    for case in most_changed(before, after, MOST):
        spent = [flown.episodes["delta_v_m_s"][case] for flown in (before, after)]
        seen = [flown.episodes["inspected_count"][case] for flown in (before, after)]
        words = f"{case}: {spent[0]:.2f} → {spent[1]:.2f} m/s, {seen[0]} → {seen[1]} points"
        shown.append(html.element("button", words, type="button", class_="quiet", data_case=case))
    return html.element("p", "Changed most: ", *shown)


def _numbers(compared: Sequence[Compared]) -> Table:
    rows: list[list[Cell]] = []
    for row in compared:
        decimals, difference = row.metric.decimals, row.difference
        is_better = (difference.mean < 0.0) == row.metric.is_less_better
        kind = "better" if is_better else "worse"
        unit = "percentage points" if row.metric.unit == "%" else row.metric.unit
        mark = Mark(f"{difference.in_words(decimals)} {unit}", kind if difference.excludes_zero else "")
        means = [f"{mean:.{decimals}f} {row.metric.unit}" for mean in row.means]
        rows.append([row.metric.label, *means, mark if row.better + row.worse else "none"])
    heads = [f"{compared[0].difference.count:,} flights", OPENED, NOW, "difference (interval)"]
    return Table(heads, rows, numbers=(1, 2, 3))


def _histogram(before: Flown, after: Flown) -> Options:
    spent = [flown.episodes["delta_v_m_s"] for flown in (before, after)]
    most = max(1e-9, *(column.max() for column in spent))
    width = 10.0 ** np.floor(np.log10(most / BINS)) * np.array([1.0, 2.0, 5.0, 10.0])
    width = width[width * BINS >= most][0]
    edges = width * np.arange(np.ceil(most / width) + 1.0)
    bars = [
        {"name": name, "type": "bar", "barGap": "-100%", "barCategoryGap": "5%", "color": colour}
        | {"itemStyle": {"opacity": 0.65}, "data": np.histogram(column, edges)[0].tolist()}
        for name, column, colour in zip((OPENED, NOW), spent, (BEFORE, AFTER), strict=True)
    ]
    labels = [f"{edge:.3g}" for edge in edges[:-1]]
    x = axis("delta-v (m/s)", type="category", data=labels, axisLabel={"interval": LABELLED - 1})
    return chart(x, axis("flights", 40), bars)


class OneFlight(Panel):
    """A case, flown by the controller as opened and as it stands.

    Parameters
    ----------
    cases : Cases
    original : FuzzyController
    """

    title = "One flight"

    def __init__(self, cases: EditorCases, original: FuzzyController) -> None:
        self._cases, self._original, self._case, self._sample = cases, original, 0, 0
        self._points, self._period_s = inspection_points(cases.mission), cases.mission.control_period_s
        self._log = lru_cache(maxsize=2)(cases.log)

    def build(self, again: Callable[[], None]) -> None:
        """Put the path, the forces and a slider of time on the page."""
        self._again, count = again, len(self._cases.scenarios)
        with ui.row().classes("one-flight"):
            self._number = ui.number("case", value=0, min=0, max=count - 1, format="%d").props("dense")
            self._number.on("change", lambda: self.choose(int(self._number.value or 0)))
            self._end = ui.label()
        self._path = ui.echart({"series": []}).classes("path")
        self._forces = ui.echart({"series": []}).classes("forces")
        last = self._cases.mission.num_controls - 1
        self._time = ui.element("input").classes("value").props(f"type=range min=0 max={last} value=0")
        self._time.props["aria-label"] = "time in the flight"
        self._time.on("input", lambda event: self._scrub(int(event.args)), js_handler=ENTERED)
        self._words = document().props('role="status"')

    def choose(self, case: int) -> None:
        """Show another case."""
        self._case = min(max(case, 0), len(self._cases.scenarios) - 1)
        self._number.set_value(self._case)
        self._again()

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Fly the case twice, unless another time is asked for."""
        case, k = self._case, self._sample
        try:
            before, after = (self._log(item, case) for item in (self._original, controller))
        except ValueError as refused:
            yield partial(self._end.set_text, str(refused))
            return
        seen, lit = int(after.is_inspected[-1].sum()), int(after.is_inspectable.sum())
        end = f"{after.delta_v_m_s[-1]:.3f} m/s, {seen} of {lit} points"
        words = "".join(html.element("p", item) for item in self._reasons(controller, after, k))
        charts = _path(before, after, k, self._points), _forces(after, k, self._period_s)
        yield partial(self._show, end, words, *charts)

    def _show(self, end: str, words: str, path: Options, forces: Options) -> None:
        self._end.set_text(end)
        tell(self._words, innerHTML=words)
        draw(self._path, path)
        draw(self._forces, forces)

    def _scrub(self, sample: int) -> None:
        self._sample = self._time.props["value"] = sample
        self._again()

    def _reasons(self, controller: FuzzyController, log: FlightLog, k: int) -> list[str]:
        """Say what was so at a sample and, for each axis, what was fired, why, and by which rule most."""
        distance, count = np.linalg.norm(log.position_m[k]), int(log.is_inspected[k].sum())
        sentences = [f"{k * self._period_s:g} s: {distance:.1f} m away, {count} points"]
        for index, system in enumerate(controller.systems):
            output = system.outputs[0].name
            requested = number(float(f"{log.force_asked_n[k, AXES[output]]:.3g}"))
            words = f"{output}: asked for {requested} N; {REASON_WORDS[log.reason[k, AXES[output]]]}"
            if log.is_decided[k]:
                explanation = explain(system, log.fis_input[k, index, : len(system.inputs)])
                for move in explanation.outputs[0].moves[:1]:
                    words += f". Rule {move.rule} most: {sentence(system.rules[move.rule - 1])}"
            sentences.append(words)
        return sentences


def _in_plane(points: Floats) -> Floats:
    """Return points of shape (n, 3), Hill axes, as along the track and radial, (n, 2)."""
    return points[:, 1::-1]


def _path(before: FlightLog, after: FlightLog, k: int, points_m: Floats) -> Options:
    """Draw two paths, and at a sample of the second the deputy and the points, (n, 3)."""
    paths, points = [_in_plane(log.position_m) for log in (before, after)], _in_plane(points_m)
    reach = round(1.1 * max(float(np.abs(path).max()) for path in paths))
    ends: Options = {"min": -reach, "max": reach, "splitLine": {"show": False}}
    seen = after.is_inspected[k]
    drawn = [
        line(paths[0], BEFORE, name=OPENED, lineStyle={"type": "dashed"}),
        line(paths[1], AFTER, name=NOW),
        dots(points[seen], SEEN, 4, name="inspected"),
        dots(points[~seen], MISSED, 4, name="not yet"),
        dots(paths[1][[k]], INK, 11, name="deputy"),
    ]
    return chart(axis("along the track (m)", **ends), axis("radial (m)", 38, **ends), drawn)


def _forces(log: FlightLog, k: int, period_s: float) -> Options:
    """Draw the force on each axis, and a line at a sample."""
    times = np.arange(len(log.force_hill_n)) * period_s
    lines = [
        line(np.column_stack([times, log.force_hill_n[:, column]]), colour, name=name, step="end")
        for (name, column), colour in zip(AXES.items(), AXIS_COLOURS, strict=True)
    ]
    now: Options = {"symbol": "none", "label": {"show": False}, "lineStyle": {"color": INK}}
    lines[0]["markLine"] = now | {"data": [{"xAxis": k * period_s}]}
    return chart(axis("time (s)", max=float(times[-1])), axis("force (N)", 42), lines)


def panels(cases: EditorCases, controller: FuzzyController) -> Sequence[Panel]:
    """Return the panels of a page: cases are flown by a controller as it was opened, and as edited."""
    single = OneFlight(cases, controller)
    return ManyFlights(cases, controller, single.choose), single
