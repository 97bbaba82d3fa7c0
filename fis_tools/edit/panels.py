"""Panels: what stands beside the terms and rules, and answers every change in its own time."""

import asyncio
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Protocol

from nicegui import background_tasks, run, ui

from fis_tools.findings import audit as audits
from fis_tools.findings.difference import difference
from fis_tools.model import FuzzyController
from fis_tools.model.intervals import has_intervals
from plain_files.document import Document, html

#: shows one part of an answer on the page
Show = Callable[[], object]
#: sends what stands in a field
ENTERED = "(event) => emit(event.target.value)"
#: an underscore in HTML that is shown, not one of an attribute
UNDERSCORE = re.compile("_(?=[^<>]*<)")


def heading(level: int, words: str) -> ui.label:
    """Put a heading on the page; return its words."""
    with ui.element(f"h{level}"):
        return ui.label(words)


def card(title: str) -> ui.element:
    """Add a card, a bordered part of the page."""
    return ui.element("section").classes("card").props(f'aria-label="{title}"')


def document() -> ui.element:
    """Put a document there, as ``innerHTML`` from `plain_files.document.html`, which escapes."""
    return ui.element("div").classes("document")


def set_properties(target: ui.element, **properties: object) -> None:
    """Set properties of an element in the page itself: its framework would go through the whole page anew."""
    target.client.run_javascript(f"Object.assign(getHtmlElement({target.id}), {json.dumps(properties)})")


class Panel(Protocol):
    """A part of the page that is computed anew after every change of the controller."""

    title: str

    def build(self, again: Callable[[], None]) -> None:
        """Put its elements on the page; ``again`` computes the panel anew, such as after a choice in it."""

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Yield the answer in parts, computed in a thread; it is dropped once the controller has changed."""


class PanelAnswers:
    """Computes the panels one after the other in a thread, always for the newest controller.

    Parameters
    ----------
    panels : sequence of (ui.element, Panel)
        With the places where they are on the page.
    """

    def __init__(self, panels: Sequence[tuple[ui.element, Panel]]) -> None:
        self._controller: FuzzyController | None = None
        #: what is still to be answered; an answer that is asked for again is another object
        self._asked: dict[Panel, object] = {}
        self._states = {panel: self._build(parent, panel) for parent, panel in panels}
        self._is_busy = False

    def _build(self, parent: ui.element, panel: Panel) -> ui.element:
        """Build a panel's card; return the element that says whether it is computing."""
        with parent, card(panel.title):
            with ui.element("div").classes("card-head"):
                heading(2, panel.title)
                state = ui.element("span").classes("state")
            panel.build(lambda: self._ask(panel))
        return state

    def ask(self, controller: FuzzyController) -> None:
        """Start all panels anew; an answer under way is dropped after its present part."""
        self._controller, self._asked = controller, {}
        self._ask(*self._states)

    def _ask(self, *panels: Panel) -> None:
        """Compute panels anew, after the answer under way."""
        for panel in panels:
            self._asked[panel] = object()
            set_properties(self._states[panel], textContent="computing …")
        if not self._is_busy and self._controller is not None:
            self._is_busy = True
            background_tasks.create(self._answer())

    async def _answer(self) -> None:
        try:
            while self._asked:
                await asyncio.sleep(0)  # what the page shows at once is on its way first
                await self._answer_first(*next(iter(self._asked.items())))
        finally:
            self._is_busy = False

    async def _answer_first(self, panel: Panel, request: object) -> None:
        assert self._controller is not None  # noqa: S101 - it comes with what is asked
        parts = panel.answers(self._controller)
        while (show := await run.io_bound(next, parts, None)) is not None:
            if self._asked.get(panel) is not request:
                return
            show()
        if self._asked.get(panel) is request:  # a touch may come while the end is looked for
            del self._asked[panel]
            set_properties(self._states[panel], textContent="")


class DocumentPanel(Panel):
    """A panel whose answer is a document.

    Parameters
    ----------
    title : str
    answer : callable
        Returns HTML that is escaped.
    """

    def __init__(self, title: str, answer: Callable[[FuzzyController], str]) -> None:
        self.title, self._answer = title, answer

    def build(self, again: Callable[[], None]) -> None:
        """Add the document's element to the page."""
        self._shown = document().props("role=status")

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Yield the answer's document."""
        yield partial(set_properties, self._shown, innerHTML=self._answer(controller))


#: systems that did not change are not audited again
_audit = lru_cache(maxsize=16)(audits.audit)


def findings(controller: FuzzyController) -> str:
    """Return an audit's findings, the worst first."""
    if any(map(has_intervals, controller.systems)):
        return html.element("p", "An audit is for type-1 sets: import --sets upper makes a file to audit.")
    all_findings = [finding for system in controller.systems for finding in _audit(system).findings]
    all_findings.sort(key=lambda finding: -finding.severity)
    words = audits.Audit("", (), tuple(all_findings)).counted() or "nothing found"
    parts = [html.element("p", words)]
    for finding in all_findings:
        summary = html.element("summary", f"{finding.system}: {finding.sentence}")
        parts.append(
            html.element("details", summary, finding.cure, class_=f"finding {finding.severity.word}")
        )
    return "".join(parts)


def changes(before: FuzzyController, after: FuzzyController) -> str:
    """Return the differences between two controllers; lines may break after underscores in names."""
    if before == after:
        return "<p>Nothing changed.</p>"
    pairs = list(zip(before.systems, after.systems, strict=True))
    changed = [pair for pair in pairs if pair[0] != pair[1]] or pairs[:1]
    olds, news = (tuple(side) for side in zip(*changed, strict=True))
    old, new = (replace(side, systems=kept, wires=()) for side, kept in ((before, olds), (after, news)))
    differences = difference(old, new)
    return UNDERSCORE.sub("_<wbr>", html.body(Document(differences.blocks())))
