"""The page: a system's terms and rules, constants, panels that answer every change, and copies."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import MappingProxyType

from nicegui import ui

from fis_tools.edit.panels import DocumentPanel, Panel, PanelAnswers, card, changes, findings, heading
from fis_tools.edit.session import Session
from fis_tools.edit.system_view import SystemView
from fis_tools.edit.touches import number
from fis_tools.formats.files import ENDINGS
from fis_tools.model import FuzzyController
from fis_tools.review.content import constants
from fis_tools.words.text import wires_in_words
from plain_files.document.html import read

PLAIN, MAIN = "flat no-caps", "unelevated no-caps"
#: Ctrl+Z and Ctrl+Y, which fields of text keep for themselves
SCRIPT = """<script>
document.addEventListener("keydown", (event) => {
  const by = { z: event.shiftKey ? 1 : -1, y: 1 }[event.key.toLowerCase()];
  const isText = event.target.matches("input:not([type=range]), textarea, select");
  if (by && (event.ctrlKey || event.metaKey) && !isText) emitEvent("step", by);
});
</script>"""


class Editor:
    """The editor in one browser window: it shows a session, and applies what is touched to it.

    Parameters
    ----------
    session : Session
        As it stands: a page that is loaded again goes on where it was.
    panels : sequence of Panel
        Those of whoever opened it, shown first.
    meanings : mapping of str to str
        What attributes of the controller mean, by their names.
    """

    def __init__(
        self,
        session: Session,
        panels: Sequence[Panel] = (),
        meanings: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.session, self._meanings = session, meanings
        self._fields: dict[str, ui.input] = {}
        ui.add_css(read("style.css") + read("style.css", "fis_tools.edit"))
        self._build_head()
        with ui.element("div").classes("editor"):
            sides = [ui.element("div").classes("side") for _ in range(2)]
        beside = sides[0 if panels else 1]
        with sides[0]:
            self._left = ui.element("div").classes("side")
        with beside:
            self._surface = ui.element("div")
        notes = (
            DocumentPanel("Findings", findings),
            DocumentPanel("Changes", partial(changes, session.original)),
        )
        self._answers = PanelAnswers(
            [*((sides[1], panel) for panel in panels), *((beside, panel) for panel in notes)]
        )
        self._choose(0)
        self._client, self._shown = ui.context.client, session.controller
        self._client.on_connect(self._refresh)
        self._client.on_delete(lambda: session.views.remove(self._refresh))
        session.views.append(self._refresh)
        self._answers.ask(session.controller)

    def _build_head(self) -> None:
        """Build the head of the page: title, status, and the buttons to undo, redo and save."""
        with ui.element("header").classes("head"):
            with ui.element("div"):
                self._title = heading(1, self.session.title)
                ui.label(str(self.session.path)).classes("about")
            self._status = ui.label().classes("status").props('role="status" aria-live="polite"')
            with ui.element("div").classes("buttons"):
                self._undo, self._redo = (
                    ui.button(word, on_click=partial(self._step, direction)).props(PLAIN)
                    for word, direction in (("Undo", -1), ("Redo", 1))
                )
                ui.button("Save a copy", on_click=self._ask_to_save, color=None).props(MAIN).classes("main")
        ui.add_body_html(SCRIPT)
        ui.on("step", lambda event: self._step(event.args))

    def _choose(self, index: int) -> None:
        """Show another system."""
        self._left.clear()
        self._surface.clear()
        with self._left:
            names = [system.name for system in self.session.controller.systems]
            with ui.element("nav").classes("systems").props('aria-label="systems"'):
                for n, name in enumerate(names if len(names) > 1 else []):
                    button = ui.button(name, on_click=lambda _, n=n: self._choose(n)).props(PLAIN)
                    button.props["aria-pressed"] = str(n == index).lower()
            if wires := [*wires_in_words(self.session.controller)]:
                with card("wires"):
                    heading(2, "Wires")
                    for words in wires:
                        ui.label(words).classes("about")
            self._view = SystemView(self.session, index, self.touch, self._surface)
            self._build_constants()
        self._show()

    def _build_constants(self) -> None:
        """Build a card with a field for each constant of the controller."""
        attributes = constants(self.session.controller, self._meanings)
        with card("constants").classes("constants") as holder:
            heading(2, "Constants")
            for constant in attributes:
                with ui.element("label"):
                    ui.label(constant.name).tooltip(constant.meaning or constant.name)
                    entry = ui.input(value=constant.exact).props(f'dense borderless suffix="{constant.unit}"')
                    entry.props["aria-label"] = constant.name
                    entry.on("change", lambda _, name=constant.name, at=entry: self._set(name, at.value))
                    self._fields[constant.name] = entry
        holder.set_visibility(bool(attributes))

    def touch(self, change: Callable[[FuzzyController], FuzzyController], gesture: object = None) -> None:
        """Apply a change, or show why it is refused; see `Session.touch`."""
        try:
            self.session.touch(change, gesture)
        except (ValueError, KeyError, IndexError) as refused:
            self._status.set_text(str(refused.args[0] if refused.args else refused))
            self._view.forget()
            self._show()
            return
        self._show_controller()

    def _set(self, name: str, value: str) -> None:
        """Set a constant of the controller to a number that was typed."""

        def change(controller: FuzzyController) -> FuzzyController:
            facts = dict(controller.attributes) | {name: f"{number(value):.12g}"}
            return replace(controller, attributes=tuple(sorted(facts.items())))

        self.touch(change)

    def _step(self, direction: int) -> None:
        self.session.step(direction)
        self._show_controller()

    def _show_controller(self) -> None:
        """Show the present controller on each page of this window."""
        self._answer()
        for refresh in self.session.views:
            refresh()

    def _refresh(self) -> None:
        """Show changes made on another page of this window, or while the connection was lost."""
        if self._client.has_socket_connection and self.session.controller is not self._shown:
            self._answer()

    def _answer(self) -> None:
        """Show the present controller, and start all panels on it."""
        self._shown = self.session.controller
        self._status.set_text("")
        self._show()
        self._answers.ask(self.session.controller)

    def _show(self) -> None:
        """Show the title, the selected system, the constants, and which steps can be undone or redone."""
        self._title.set_text(self.session.title)
        self._view.show()
        for constant in constants(self.session.controller, self._meanings):
            self._fields[constant.name].set_value(constant.exact)
        self._undo.set_enabled(self.session.can_step(-1))
        self._redo.set_enabled(self.session.can_step(1))

    def _ask_to_save(self) -> None:
        """Open a dialog that asks for a file name, and save a copy of the controller there."""
        with ui.dialog() as dialog, ui.card().classes("save"):
            heading(2, "Save a copy")
            target = ui.input("file", value=str(self.session.proposed())).props("autofocus").classes("w-full")
            ui.label(f"Its ending chooses the form: {', '.join(ENDINGS)}.").classes("about")
            replaces = ui.checkbox("replace a file that is there")
            refusal = ui.label().classes("refused").props('role="alert"')

            def save() -> None:
                try:
                    done = self.session.save(Path(target.value).expanduser(), replaces.value)
                except (ValueError, OSError) as refused:
                    refusal.set_text(str(refused))
                    return
                self._show()
                self._status.set_text("; ".join(done))
                dialog.close()

            target.on("keydown.enter", save)
            with ui.row().classes("w-full justify-end"):
                ui.button("Cancel", on_click=dialog.close).props(PLAIN)
                ui.button("Save", on_click=save, color=None).props(MAIN).classes("main")
        dialog.on("hide", dialog.delete)
        dialog.open()  # file: none, a dialog
