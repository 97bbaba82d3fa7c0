"""The mission's panels: what many flights came to, and one of them, scrubbed by time."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from nicegui import run, ui

from fis_tools.document import Cell, Document, Mark, Table, html
from fis_tools.edit import page
from fis_tools.edit.charts import Options, axis, chart, dots, draw, line
from fis_tools.edit.panels import Panel, Show, document
from fis_tools.findings.explanation import explain
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import REASONS
from fis_tools.words.text import number, sentence
from pipeline.array_types import Floats
from pipeline.edit.flights import Cases, Flown, most_changed
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.statistics import Compared
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import AXES, CONSTANTS
from pipeline.flight.world.pack import inspection_points
from pipeline.settings.experiment import Experiment

#: bins of the histogram, and flights that changed most, as shown
BINS, MOST = 40, 6
OPENED, NOW = "as opened", "now"
BEFORE, AFTER, SEEN, MISSED, INK = "#9aa4ae", "#1f5fa8", "#3f7d3a", "#a02018", "#1b1f24"
AXIS_COLOURS = ("#be5014", AFTER, SEEN)
REASON_OF = tuple(REASONS)


class ManyFlights:
    """What all cases came to, beside those of the controller that was opened.

    Parameters
    ----------
    cases : Cases
    original : FuzzyController
    choose : callable
        Shows a case alone.
    """

    title = "Flights"

    def __init__(self, cases: Cases, original: FuzzyController, choose: Callable[[int], None]) -> None:
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
                numbers = html.body(Document([_numbers(self._cases.compare(before, after))]))
                below = html.body(Document([_judged(after.verdicts(self._cases.requirements))]))
                if controller != self._original:
                    below = _changed_most(before, after) + below
                yield partial(self._show, str(numbers), str(below), _histogram(before, after))
        except ValueError as refused:
            yield partial(self._numbers.set_content, str(html.element("p", str(refused), class_="worse")))

    def _show(self, numbers: str, below: str, bars: Options) -> None:
        self._numbers.set_content(numbers)
        self._below.set_content(below)
        draw(self._chart, bars)


def _judged(verdicts: Sequence[tuple[Requirement, str, str]]) -> Table:
    rows: list[list[Cell]] = [
        [f"{one.id} {one.title}", Mark(word, word.replace(" ", "-"), note=why)] for one, word, why in verdicts
    ]
    return Table(["requirement", "verdict"], rows)


def _changed_most(before: Flown, after: Flown) -> Markup:
    """Return a button for each of the flights that changed most."""
    shown = []
    for case in most_changed(before, after, MOST):
        spent = [one.episodes["delta_v_m_s"][case] for one in (before, after)]
        seen = [one.episodes["inspected_count"][case] for one in (before, after)]
        words = f"{case}: {spent[0]:.2f} → {spent[1]:.2f} m/s, {seen[0]} → {seen[1]} points"
        shown.append(html.element("button", words, type="button", class_="quiet", data_case=case))
    return html.element("p", "Changed most: ", *shown)


def _numbers(compared: Sequence[Compared]) -> Table:
    rows: list[list[Cell]] = []
    for one in compared:
        places, found = one.metric.places, one.difference
        change = f"{found.mean:+.{places}f} ({found.low:+.{places}f} to {found.high:+.{places}f})"
        is_better = (found.mean < 0.0) == one.metric.is_less_better
        mark = Mark(change, ("better" if is_better else "worse") if found.is_told else "")
        means = [f"{mean:.{places}f} {one.metric.unit}" for mean in one.means]
        rows.append([one.metric.label, *means, mark if one.better + one.worse else "none"])
    heads = [f"{compared[0].difference.count:,} flights", OPENED, NOW, "difference (interval)"]
    return Table(heads, rows, numbers=(1, 2, 3))


def _histogram(before: Flown, after: Flown) -> Options:
    spent = [one.episodes["delta_v_m_s"] for one in (before, after)]
    edges = np.linspace(0.0, max(1e-9, *(column.max() for column in spent)), BINS + 1)
    bars = [
        {"name": name, "type": "bar", "barGap": "-100%", "barCategoryGap": "5%", "color": colour}
        | {"itemStyle": {"opacity": 0.65}, "data": np.histogram(column, edges)[0].tolist()}
        for name, column, colour in zip((OPENED, NOW), spent, (BEFORE, AFTER), strict=True)
    ]
    labels = [f"{edge:.2f}" for edge in edges[:-1]]
    return chart(axis("delta-v (m/s)", type="category", data=labels), axis("flights", 40), bars)


class OneFlight:
    """A case, flown by the controller as opened and as it stands.

    Parameters
    ----------
    cases : Cases
    original : FuzzyController
    """

    title = "One flight"

    def __init__(self, cases: Cases, original: FuzzyController) -> None:
        self._cases, self._original, self._case, self._sample = cases, original, 0, 0
        self._points = inspection_points(cases.mission)
        self._before: tuple[int, FlightLog] | None = None
        self._flown: tuple[FuzzyController, FlightLog] | None = None

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
        read = "(event) => emit(Number(event.target.value))"
        self._time.on("input", lambda event: self._scrub(event.args), js_handler=read)
        self._words = document().props('role="status"')

    def choose(self, case: int) -> None:
        """Show another case."""
        self._case = min(max(case, 0), len(self._cases.scenarios) - 1)
        self._number.set_value(self._case)
        self._again()

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Fly the case twice."""
        case = self._case
        try:
            if self._before is None or self._before[0] != case:
                self._before = case, self._cases.log(self._original, case)
            before, after = self._before[1], self._cases.log(controller, case)
        except ValueError as refused:
            yield partial(self._end.set_text, str(refused))
            return
        words = self._reasons(controller, after, self._sample)
        yield partial(self._show, controller, before, after, words)

    def _show(
        self, controller: FuzzyController, before: FlightLog, after: FlightLog, words: list[str]
    ) -> None:
        self._flown = controller, after
        draw(self._path, _path(before, after))
        draw(self._forces, _forces(after, self._cases.mission.control_period_s))
        seen, lit = int(after.is_inspected[-1].sum()), int(after.is_inspectable.sum())
        self._end.set_text(f"{after.delta_v_m_s[-1]:.3f} m/s, {seen} of {lit} points")
        self._show_sample(after, self._sample, words)

    async def _scrub(self, sample: int) -> None:
        self._sample = self._time.props["value"] = sample
        if self._flown is None:
            return
        controller, log = self._flown
        words = await run.io_bound(self._reasons, controller, log, sample)
        if sample == self._sample and words is not None:  # else a later time is asked for
            self._show_sample(log, sample, words)

    def _show_sample(self, log: FlightLog, k: int, words: Sequence[str]) -> None:
        self._words.set_content("".join(html.element("p", one) for one in words))
        seen = log.is_inspected[k]
        told = (
            (SEEN_POINTS, self._points[seen]),
            (LEFT_POINTS, self._points[~seen]),
            (DEPUTY, log.position_m[[k]]),
        )
        series = [{"name": name, "data": _in_plane(points).round(2).tolist()} for name, points in told]
        self._path.run_chart_method("setOption", {"series": series})
        now = [{"xAxis": k * self._cases.mission.control_period_s}]
        self._forces.run_chart_method(
            "setOption", {"series": [{"name": "force_x", "markLine": {"data": now}}]}
        )

    def _reasons(self, controller: FuzzyController, log: FlightLog, k: int) -> list[str]:
        """Say what was so at a sample and, for each axis, what was fired, why, and by which rule most."""
        distance, count = np.linalg.norm(log.position_m[k]), int(log.is_inspected[k].sum())
        told = [f"{k * self._cases.mission.control_period_s:g} s: {distance:.1f} m away, {count} points"]
        for place, system in enumerate(controller.systems):
            output = system.outputs[0].name
            asked = number(float(f"{log.force_asked_n[k, AXES[output]]:.3g}"))
            words = f"{output}: asked for {asked} N; {REASONS[REASON_OF[log.reason[k, AXES[output]]]]}"
            if log.is_decided[k]:
                moves = explain(system, log.fis_input[k, place, : len(system.inputs)]).outputs[0].moves
                rules = [
                    f". Rule {one.rule} most: {sentence(system.rules[one.rule - 1])}" for one in moves[:1]
                ]
                words += "".join(rules)
            told.append(words)
        return told


SEEN_POINTS, LEFT_POINTS, DEPUTY = "inspected", "not yet", "deputy"


def _in_plane(points: Floats) -> Floats:
    """Return points of shape (n, 3), Hill axes, as along the track and radial, (n, 2)."""
    return points[:, 1::-1]


def _path(before: FlightLog, after: FlightLog) -> Options:
    paths = [_in_plane(log.position_m) for log in (before, after)]
    reach = round(1.1 * max(float(np.abs(path).max()) for path in paths))
    ends: Options = {"min": -reach, "max": reach, "splitLine": {"show": False}}
    none = np.empty((0, 2))
    lines = [
        line(paths[0], BEFORE, name=OPENED, lineStyle={"type": "dashed"}),
        line(paths[1], AFTER, name=NOW),
        dots(none, SEEN, 4, name=SEEN_POINTS),
        dots(none, MISSED, 4, name=LEFT_POINTS),
        dots(none, INK, 11, name=DEPUTY),
    ]
    return chart(axis("along the track (m)", **ends), axis("radial (m)", 38, **ends), lines)


def _forces(log: FlightLog, period_s: float) -> Options:
    times = np.arange(len(log.force_hill_n)) * period_s
    lines = [
        line(np.column_stack([times, log.force_hill_n[:, place]]), colour, name=name, step="end")
        for (name, place), colour in zip(AXES.items(), AXIS_COLOURS, strict=True)
    ]
    # one line for the time that is shown
    lines[0]["markLine"] = {
        "symbol": "none",
        "label": {"show": False},
        "lineStyle": {"color": INK},
        "data": [],
    }
    return chart(axis("time (s)", max=float(times[-1])), axis("force (N)", 42), lines)


def open_editor(
    path: Path,
    controller: FuzzyController,
    experiment: Experiment,
    requirements: Sequence[Requirement],
    **served: Any,
) -> None:
    """Serve an editor beside a mission until Ctrl-C; see `fis_tools.edit.page.open_editor`.

    Parameters
    ----------
    path : Path
        What the controller was read from.
    controller : FuzzyController
    experiment : Experiment
        Its mission and the cases of its evaluation are flown.
    requirements : sequence of Requirement
        Judged by these cases.
    **served
        ``port`` and ``opens``.
    """

    def panels() -> Sequence[Panel]:
        cases = Cases(experiment, requirements)
        one = OneFlight(cases, controller)
        return ManyFlights(cases, controller, one.choose), one

    meanings = {name: kind.description for name, kind in CONSTANTS.items()}
    page.open_editor(path, controller, panels, meanings, **served)
