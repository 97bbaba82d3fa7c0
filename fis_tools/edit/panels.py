"""Panels: what stands beside the terms and rules, and answers every change in its own time."""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Protocol

from nicegui import background_tasks, run, ui

from fis_tools.document import Document, html
from fis_tools.findings import audit as audits
from fis_tools.findings.difference import difference
from fis_tools.model import FuzzyController, FuzzySystem

#: shows one part of an answer on the page
Show = Callable[[], object]


def heading(level: int, words: str) -> None:
    """Put a heading on the page."""
    with ui.element(f"h{level}"):
        ui.label(words)


class Panel(Protocol):
    """Something that answers every change of a controller."""

    title: str

    def build(self, again: Callable[[], None]) -> None:
        """Put its elements on the page; ``again`` asks it anew, for what it was told in another way."""

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Compute an answer in parts, in a thread; the parts of an answer that is stale are not asked for."""


class Answering:
    """Asks a panel about the newest controller alone, without holding the page up.

    Parameters
    ----------
    panel : Panel
    state : ui.label
        Says whether an answer is being computed.
    turn : asyncio.Lock
        Of all panels of a window, one at a time computes its first part: Python runs one thread anyway.
    """

    def __init__(self, panel: Panel, state: ui.label, turn: asyncio.Lock) -> None:
        self._panel, self._state, self._turn = panel, state, turn
        self._newest: FuzzyController | None = None
        self._asked: FuzzyController | None = None
        self._is_busy = False
        panel.build(self._again)

    def ask(self, controller: FuzzyController) -> None:
        """Ask for an answer; one that is being computed is dropped after its present part."""
        self._newest = self._asked = controller
        if not self._is_busy:
            self._is_busy = True
            background_tasks.create(self._answer())

    def _again(self) -> None:
        if self._asked is not None:
            self.ask(self._asked)

    async def _answer(self) -> None:
        try:
            while self._newest is not None:
                asked, self._newest = self._newest, None
                parts, turn = self._panel.answers(asked), self._turn
                with self._state:
                    self._state.set_text("…")
                while self._newest is None:
                    async with turn:
                        show = await run.io_bound(next, parts, None)
                    turn = asyncio.Lock()
                    if show is None:
                        break
                    if self._newest is None:
                        with self._state:
                            show()
        finally:
            self._is_busy = False
            self._state.set_text("")


class Findings:
    """What an audit finds; only systems that changed are audited again."""

    title = "Findings"

    def __init__(self) -> None:
        self._known: dict[str, tuple[FuzzySystem, audits.Audit]] = {}

    def build(self, again: Callable[[], None]) -> None:
        """Put a list on the page."""
        self._summary = ui.label().props("role=status")
        self._list = ui.column().classes("findings")

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Audit."""
        known = dict(self._known)
        for system in controller.systems:
            if known.get(system.name, (None,))[0] is not system:
                known[system.name] = (system, audits.audit(system))
        self._known = known
        found = [one for system in controller.systems for one in known[system.name][1].findings]
        found.sort(key=lambda one: -one.severity)

        def show() -> None:
            counts = {one.severity: 0 for one in found}
            for one in found:
                counts[one.severity] += 1
            self._summary.set_text(", ".join(s.counted(n) for s, n in counts.items()) or "nothing found")
            self._list.clear()
            with self._list:
                for one in found:
                    with ui.element("details").classes(f"finding {one.severity.word}"):
                        with ui.element("summary"):
                            ui.label(f"{one.system}: {one.sentence}")
                        ui.label(one.cure)

        yield show


class Changes:
    """What differs from the controller that was opened.

    Parameters
    ----------
    original : FuzzyController
    """

    title = "Changes"

    def __init__(self, original: FuzzyController) -> None:
        self._original = original

    def build(self, again: Callable[[], None]) -> None:
        """Put a document on the page."""
        self._shown = ui.html("", sanitize=False).classes("document")  # its writer escapes

    def answers(self, controller: FuzzyController) -> Iterator[Show]:
        """Compare; systems that are the same are left out."""
        if controller == self._original:
            yield partial(self._show, "<p>Nothing changed.</p>")
            return
        before, after = self._original, controller
        pairs = list(zip(before.systems, after.systems, strict=True))
        changed = [pair for pair in pairs if pair[0] != pair[1]] or pairs[:1]
        olds, news = (tuple(side) for side in zip(*changed, strict=True))
        found = difference(replace(before, systems=olds), replace(after, systems=news))
        body = str(html.body(Document(found.document().blocks[2:])))
        yield partial(self._show, body)

    def _show(self, body: str) -> None:
        self._shown.set_content(body)
