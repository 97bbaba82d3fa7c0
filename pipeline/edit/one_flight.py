"""One flight of the cases: its path in three dimensions, its forces, and the rules behind them."""

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from typing import Any

import numpy as np
from nicegui import ui

from fis_tools.edit.charts import AFTER, AXIS_COLOURS, Chart, Options, axis, chart, line
from fis_tools.edit.panels import Panel, Show, document, set_properties
from fis_tools.findings.explanation import explain
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import REASONS
from fis_tools.words.text import number, sentence
from pipeline.edit.cases import EditorCases
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.state.log import FlightLog
from pipeline.flight.state.signals import AXES
from pipeline.recording.foresight import decision_at
from pipeline.report.scene import flight_table
from plain_files.document import html
from plain_files.document.html import read
from telemetry.page.panel import FOLDER, PACKAGE

REASON_WORDS = tuple(REASONS.values())
#: the scene that reports have
VIEW = FOLDER


class _SceneView(ui.element, component="scene.js", esm={"flight-view": str(VIEW)}):
    """A flight in three dimensions; see ``scene.js``."""


class OneFlight(Panel):
    """A case, flown by the controller as opened and as it stands.

    Parameters
    ----------
    cases : EditorCases
    original : FuzzyController
    """

    title = "One flight"

    def __init__(self, cases: EditorCases, original: FuzzyController) -> None:
        self._cases, self._original, self._case, self._sample = cases, original, 0, 0
        self._period_s = cases.mission.control_period_s
        self._inspects = cases.mission.problem.kind == "inspection"
        self._log = lru_cache(maxsize=2)(cases.log)
        self._drawn: tuple[int, FuzzyController] | None = None

    def build(self, again: Callable[[], None]) -> None:
        """Put the scene and the forces on the page."""
        self._again, count = again, len(self._cases.scenarios)
        ui.add_css(read("view.css", PACKAGE) + read("scene.css", "pipeline.edit"))
        with ui.row().classes("one-flight"):
            self._number = ui.number("case", value=0, min=0, max=count - 1, format="%d").props("dense")
            self._number.on("change", lambda: self.choose(int(self._number.value or 0)))
            self._end = ui.label()
        self._scene = _SceneView().classes("flight-scene")
        self._scene.props["frame"] = read("frame.html", PACKAGE)
        self._scene.on("time", lambda event: self._scrub(event.args["sample"]))
        self._words = document().props('role="status"')
        self._forces = Chart("forces")

    def choose(self, case: int) -> None:
        """Show another case."""
        self._case = min(max(case, 0), len(self._cases.scenarios) - 1)
        self._number.set_value(self._case)
        self._again()

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Fly the case by the controller as opened and as edited; show the flight and the chosen instant."""
        case, sample = self._case, self._sample
        try:
            before, after = (self._log(item, case) for item in (self._original, controller))
        except ValueError as refused:
            yield partial(self._end.set_text, str(refused))
            return
        if (case, controller) != self._drawn:
            seen, lit = int(after.is_inspected[-1].sum()), int(after.is_inspectable.sum())
            points = (
                f"{seen} of {lit} points" if self._inspects else "at the goal" if seen else "not at the goal"
            )
            end = f"{after.delta_v_m_s[-1]:.3f} m/s, {points}"
            mission = mission_of_case(self._cases.mission, self._cases.scenarios[case])
            scene = flight_table(after, mission), before.position_m.round(3).tolist()
            yield partial(self._show_flight, (case, controller), end, scene, _forces(after, self._period_s))
        sample = min(sample, len(after.force_hill_n) - 1)
        words = "".join(html.element("p", item) for item in self._reasons(controller, after, sample))
        yield partial(self._show_instant, words, _instant(sample * self._period_s))

    def _show_flight(
        self, drawn: tuple[int, FuzzyController], end: str, scene: tuple[Any, Any], forces: Options
    ) -> None:
        """Show a flight: how it ended, the scene, and the forces."""
        self._drawn = drawn
        self._end.set_text(end)
        self._scene.run_method("show", *scene)
        self._forces.draw(forces)

    def _show_instant(self, words: str, mark: Options) -> None:
        set_properties(self._words, innerHTML=words)
        self._forces.draw(mark)

    def _scrub(self, sample: int) -> None:
        self._sample = sample
        self._again()

    def _reasons(self, controller: FuzzyController, log: FlightLog, k: int) -> list[str]:
        """Describe a sample: its state and, for each axis, what was fired, why, and by which rule most."""
        distance, count = np.linalg.norm(log.position_m[k]), int(log.is_inspected[k].sum())
        points = f", {count} points" if self._inspects else ""
        sentences = [f"{k * self._period_s:g} s: {distance:.1f} m away{points}"]
        for index, system in enumerate(controller.systems):
            output = system.outputs[0].name
            requested = number(float(f"{log.force_asked_n[k, AXES[output]]:.3g}"))
            words = f"{output}: asked for {requested} N; {REASON_WORDS[log.reason[k, AXES[output]]]}"
            if log.is_decided[k]:
                explanation = explain(system, log.fis_input[k, index, : len(system.inputs)])
                for move in explanation.outputs[0].moves[:1]:
                    words += f". Mainly rule {move.rule}: {sentence(system.rules[move.rule - 1])}"
            sentences.append(words)
        planned = decision_at(self._cases.mission, log, k)
        return [*sentences, f"{planned[:1].upper()}{planned[1:]}."] if planned else sentences


def _forces(log: FlightLog, period_s: float) -> Options:
    """Draw the force on each axis."""
    times = np.arange(len(log.force_hill_n)) * period_s
    lines = [
        line(np.column_stack([times, log.force_hill_n[:, column]]), colour, name=name, step="end")
        for (name, column), colour in zip(AXES.items(), AXIS_COLOURS, strict=True)
    ]
    return chart(axis("time (s)", max=float(times[-1])), axis("force (N)", 42), lines)


def _instant(time_s: float) -> Options:
    """Draw a line at a time."""
    mark: Options = {"symbol": "none", "label": {"show": False}, "lineStyle": {"color": AFTER}}
    return {"series": [{"name": next(iter(AXES)), "markLine": mark | {"data": [{"xAxis": time_s}]}}]}
