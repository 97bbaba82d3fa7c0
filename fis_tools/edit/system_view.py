"""One system on the page: its rules, its terms with sliders of its inputs, what it infers, its surface."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from fis_tools.analysis import arrays
from fis_tools.edit import charts, shown, touches
from fis_tools.edit.panels import ENTERED, card, document, heading, set_properties
from fis_tools.edit.session import Session
from fis_tools.engines.inference import infer
from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.operators import AND_OPERATORS, OR_OPERATORS
from fis_tools.words.text import rule_tables

#: points along each axis of a surface
FINE = 33


class _VariableView(ui.element, component="terms.js"):
    """A variable; see ``terms.js``."""

    #: how many touches of its terms have been answered
    touches = 0


class _RulesView(ui.element, component="rules.js"):
    """The rules; see ``rules.js``."""


class SystemView:
    """One system on the page.

    Parameters
    ----------
    session : Session
    index : int
        Which of its systems.
    touch : callable
        Takes a step, as `Session.touch` does, and shows what came of it.
    beside : ui.element
        Where the surface is.
    """

    def __init__(self, session: Session, index: int, touch: Callable[..., None], beside: ui.element) -> None:
        self._session, self._place, self._touch = session, index, touch
        self._rule: int | None = None
        self._told: dict[tuple[ui.element, str], object] = {}
        self._operators: dict[str, ui.select] = {}
        system = self.system
        self._values = [0.5 * (variable.minimum + variable.maximum) for variable in system.inputs]
        with card("rules"):
            self._build_rules(system)
        with card("terms"):
            self._inputs = [self._variable("input", variable, n) for n, variable in enumerate(system.inputs)]
            self._outputs = [
                self._variable("output", variable, n) for n, variable in enumerate(system.outputs)
            ]
        with beside, card("surface"):
            self._build_surface(system)

    @property
    def system(self) -> FuzzySystem:
        """The system as it stands."""
        return self._session.controller.systems[self._place]

    def _build_rules(self, system: FuzzySystem) -> None:
        """Build the rules' table or list, and below it the editor of the selected rule."""
        with ui.element("div").classes("card-head"):
            heading(2, "Rules")
            self._as_list = ui.switch("as a list", on_change=self.show).props("dense size=sm")
            self._as_list.set_visibility(rule_tables(system) is not None)
        self._rules = _RulesView()
        self._rules.on("turn", lambda event: self._change(partial(touches.turned, **event.args)))
        self._rules.on("select", lambda event: self._select(event.args["rule"]))
        with ui.element("div").classes("rule-editor"):
            self._sentence = ui.element("input").props('aria-label="the rule in words"')
            self._sentence.on(
                "change", lambda event: self._say(touches.with_sentence, event.args), js_handler=ENTERED
            )
            with ui.row().classes("rule-tools"):
                for name, known in (("and_operator", AND_OPERATORS), ("or_operator", OR_OPERATORS)):
                    choice = ui.select(list(known), label=f"{name.removesuffix('_operator')}:")
                    choice.props("dense options-dense stack-label borderless")
                    self._operators[name] = choice.on("update:model-value", partial(self._operate, name))
                buttons = (("+ rule", "repeat the rule", 2), ("− rule", "remove the rule", 0))
                for words, label, times in buttons:
                    button = ui.button(words, on_click=partial(self._say, touches.repeated, times))
                    button.props("flat no-caps dense").props["aria-label"] = label

    def _variable(self, kind: str, variable: Variable, index: int) -> _VariableView:
        """Build the view of a variable: its terms and, of an input, a slider."""
        view = _VariableView()
        view.props["kind"], view.props["start"] = kind, self._values[index] if kind == "input" else None
        view.on("touch", lambda event: self._touch_term(view, variable.name, event.args))
        view.on("slide", lambda event: self._slide(index, float(event.args["value"])))
        return view

    def _build_surface(self, system: FuzzySystem) -> None:
        """Build the chart of the output's surface, and the choice of its two axes."""
        names = [variable.name for variable in system.inputs]
        with ui.element("div").classes("card-head"):
            heading(2, f"Surface of {system.outputs[0].name}")
            shown_names = names[:2] if len(names) > 2 else []
            self._axes = [
                ui.select(names, value=name, label=label, on_change=self._show_surface)
                for name, label in zip(shown_names, ("to the right:", "upwards:"), strict=False)
            ]
            for choice in self._axes:
                choice.props("dense options-dense stack-label borderless")
        self._surface = charts.Chart("surface")
        self._scale = document().classes("scale")

    # what the user does

    def _change(self, change: Callable[[FuzzySystem], FuzzySystem], gesture: object = None) -> None:
        self._touch(lambda controller: touches.with_system(controller, change(self.system)), gesture)

    def _touch_term(self, view: _VariableView, name: str, details: dict[str, Any]) -> None:
        view.touches = details.pop("touches")
        gesture = (self.system.name, name, details.pop("gesture"))
        self._change(lambda system: touches.term_touched(system, system.variable(name), **details), gesture)

    def _operate(self, name: str) -> None:
        self._change(lambda system: replace(system, **{name: self._operators[name].value}))

    def _say(self, change: Callable[..., FuzzySystem], value: object) -> None:
        rule = self._rule
        if rule is not None:
            self._change(lambda system: change(system, rule, value))

    def _slide(self, index: int, value: float) -> None:
        """Set an input, and infer anew."""
        self._values[index] = value
        self._infer()
        if len(self._values) > 2:
            self._show_surface()

    def _select(self, rule: int) -> None:
        self._rule = rule
        self._show_sentence()

    # what it shows

    def forget(self) -> None:
        """Send everything when it is shown next: the page has what was refused."""
        self._told.clear()

    def show(self) -> None:
        """Show the system as it stands; only what changed is sent."""
        system = self.system
        for view, variable in zip((*self._inputs, *self._outputs), system.variables, strict=True):
            self._call_view(view, "show", shown.variable(variable), view.touches)
        for name, choice in self._operators.items():
            choice.set_value(getattr(system, name))
        before = {original.name: original for original in self._session.original.systems}.get(system.name)
        self._call_view(self._rules, "show", shown.rules(system, before, self._as_list.value))
        self._show_sentence()
        self._show_surface()
        self._infer()

    def _call_view(self, view: ui.element, method: str, *arguments: object) -> None:
        if self._told.get((view, method)) != arguments:
            self._told[view, method] = arguments
            view.run_method(method, *arguments)

    def _show_sentence(self) -> None:
        """Show the selected rule in words, if it has any."""
        rules = self.system.rules
        if self._rule is not None and self._rule >= len(rules):
            self._rule = None
        words = None if self._rule is None else shown.sentence(self.system, self._rule)
        hint = (
            "press a rule to change it in words" if self._rule is None else "this rule has no words to change"
        )
        set_properties(self._sentence, value=words or "", disabled=words is None, placeholder=hint)

    def _infer(self) -> None:
        """Infer at the inputs set, and show all degrees and outputs."""
        inference = infer(self.system, np.array(self._values))
        for view, degrees in zip(self._inputs, inference.memberships, strict=True):
            self._call_view(view, "infer", degrees.round(4).tolist())
        for view, output in zip(self._outputs, inference.outputs, strict=True):
            cuts = output.cuts.round(4).tolist() if output.variable.has_sets else []
            self._call_view(view, "infer", cuts, float(output.value))
        self._call_view(self._rules, "fire", inference.firing_strengths.round(3).tolist())

    def _show_surface(self) -> None:
        """Compute and draw the output over the chosen axes; over the only input as a curve."""
        system = self.system
        names = [entry.name for entry in system.inputs]
        axes = [entry.value for entry in self._axes] or names[:2]
        if len(set(axes)) == 2:
            fixed = {name: x for name, x in zip(names, self._values, strict=True) if name not in axes}
            options = charts.surface(arrays.surface(system, *axes, fixed=fixed, num_points=FINE))
            self._show_scale(charts.scale(system.outputs[0]))
        elif len(names) == 1:
            points = np.linspace(system.inputs[0].minimum, system.inputs[0].maximum, 8 * FINE)
            options = charts.curve(system, points, arrays.evaluate(system, points[:, np.newaxis])[:, 0])
        else:
            return
        self._surface.draw(options)

    def _show_scale(self, scale: str) -> None:
        if self._told.get((self._scale, "scale")) != (scale,):
            self._told[self._scale, "scale"] = (scale,)
            set_properties(self._scale, innerHTML=scale)
