"""The panels of a mission: the results of all cases, and one flight."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from markupsafe import Markup

from fis_tools.edit.charts import AFTER, BEFORE, Chart, Options, axis, chart
from fis_tools.edit.panels import Panel, Show, document, set_properties
from fis_tools.model import FuzzyController
from pipeline.edit.cases import EditorCases, Flown, most_changed
from pipeline.edit.one_flight import OneFlight
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.assurance.verdicts import percent
from pipeline.evaluation.paired_runs import Compared
from pipeline.flight.fly.replanning import foresees
from plain_files.document import Cell, Document, Mark, Table, html

#: bins of the histogram at most, and from one label to the next; flights that are shown
BINS, LABELLED, MOST, MOST_FAILING = 40, 5, 6, 3
RULES_ALONE = "Flown by the rules alone: foresight takes too long for so many. One flight has it."
OPENED, NOW = "as opened", "now"


class ManyFlights(Panel):
    """The results of all cases, beside those of the controller as opened.

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
        self._chart = Chart("histogram")
        self._below = document()
        pressed = "(event) => event.target.dataset.case && emit(Number(event.target.dataset.case))"
        self._below.on("click", lambda event: self._choose(event.args), js_handler=pressed)

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Yield the results of the first cases, then of more, then of all."""
        if not self._before:
            self._before = list(self._cases.fly(self._original))
        try:
            for before, after in zip(self._before, self._cases.fly(controller), strict=True):
                # parts that are not shown let a touch come between
                is_shown = before in (self._before[0], self._before[-1])
                yield self._summary(controller, before, after) if is_shown else lambda: None
        except ValueError as refused:
            yield partial(
                set_properties, self._numbers, innerHTML=html.element("p", str(refused), class_="worse")
            )

    def _summary(self, controller: FuzzyController, before: Flown, after: Flown) -> Show:
        """Return a function that shows the results so far: numbers, verdicts, and the histogram."""
        numbers = html.body(Document([_numbers(self._cases.compare(before, after))]))
        below = Markup().join(_judged(after, *judged) for judged in after.verdicts(self._cases.requirements))
        if controller != self._original:
            below = _changed_most(before, after) + below
        if foresees(self._cases.ready(controller)):
            below = html.element("p", RULES_ALONE) + below
        return partial(self._show, str(numbers), str(below), _histogram(before, after))

    def _show(self, numbers: str, below: str, bars: Options) -> None:
        set_properties(self._numbers, innerHTML=numbers)
        set_properties(self._below, innerHTML=below)
        self._chart.draw(bars)


def _judged(flown: Flown, requirement: Requirement, word: str, why: str) -> Markup:
    """Return a requirement with its verdict, and buttons for its worst failing flights."""
    head = html.element("b", f"{requirement.id} {requirement.title}: ")
    verdict = html.element("span", word, class_=word.replace(" ", "-"))
    reason = html.element("p", f"{requirement.text} {why}.", class_="about")
    if failing := [int(case) for case in flown.failing(requirement, MOST_FAILING)]:
        is_all = requirement.probability == 1.0
        share = "all flights" if is_all else f"{percent(requirement.probability)} of flights"
        words = f"It is required of {share}; a failure means {requirement.consequence}. The worst: "
        buttons = (_button(case, f"flight {case}") for case in failing)
        reason += html.element("p", words, *buttons, class_="about")
    return html.element("div", html.element("p", head, verdict), reason, class_="requirement")


def _button(case: int, words: str) -> Markup:
    """Return a button that shows a case."""
    return html.element("button", words, type="button", class_="quiet", data_case=case)


def _changed_most(before: Flown, after: Flown) -> Markup:
    """Return a button for each of the flights that changed most."""
    shown = []
    for case in most_changed(before, after, MOST):
        spent = [flown.episodes["delta_v_m_s"][case] for flown in (before, after)]
        seen = [flown.episodes["inspected_count"][case] for flown in (before, after)]
        words = f"{case}: {spent[0]:.2f} → {spent[1]:.2f} m/s, {seen[0]} → {seen[1]} points"
        shown.append(_button(case, words))
    return html.element("p", "Changed most: ", *shown)


def _numbers(compared: Sequence[Compared]) -> Table:
    """Return a table of the metrics before and after the edit, with the differences and their intervals."""
    rows: list[list[Cell]] = []
    for row in compared:
        decimals, difference = row.metric.decimals, row.difference
        is_better = (difference.mean < 0.0) == row.metric.is_less_better
        kind = "better" if is_better else "worse"
        unit = "percentage points" if row.metric.unit == "%" else row.metric.unit
        mark = Mark(f"{difference.in_words(decimals)} {unit}", kind if row.is_shown else "")
        means = [f"{mean:.{decimals}f} {row.metric.unit}" for mean in row.means]
        rows.append([row.metric.label, *means, mark if row.better + row.worse else "none"])
    heads = [f"{compared[0].difference.count:,} flights", OPENED, NOW, "difference (interval)"]
    return Table(heads, rows, numbers=(1, 2, 3))


def _histogram(before: Flown, after: Flown) -> Options:
    """Return a chart of the flights' delta-v, before and after the edit, in bins of a round width."""
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


def panels(cases: EditorCases, controller: FuzzyController) -> Sequence[Panel]:
    """Return the panels of a page: cases are flown by a controller as it was opened, and as edited."""
    single = OneFlight(cases, controller)
    return ManyFlights(cases, controller, single.choose), single
