"""A controller without some of its ways to look ahead: after its plan, as on board, or by its rules alone."""

from dataclasses import replace
from functools import lru_cache

from pipeline.flight.control.controller import RuleController, from_fuzzy
from pipeline.flight.state.signals import constant


@lru_cache(maxsize=32)
def finishing(controller: RuleController) -> RuleController:
    """Return a controller as it flies after its plan: without looking ahead, and coasting sooner."""
    attributes = _without(controller, "foresight", "rehearsal")
    points = controller.constants[constant("foresight_coast_points")]
    if points > 0.0:
        attributes["coast_below_points"] = repr(float(points))
    return _with(controller, attributes)


@lru_cache(maxsize=32)
def bare(controller: RuleController) -> RuleController:
    """Return a controller that plans as on board, see `Deputies.is_bare`."""
    return _with(controller, {**_without(controller), "foresight_bare": "1"})


@lru_cache(maxsize=32)
def rules_alone(controller: RuleController) -> RuleController:
    """Return a controller without its foresight and rehearsals: its rules are left."""
    return _with(controller, _without(controller, "foresight", "rehearsal"))


@lru_cache(maxsize=32)
def rehearsing(controller: RuleController) -> RuleController:
    """Return a controller without its foresight; it still rehearses."""
    return _with(controller, _without(controller, "foresight"))


@lru_cache(maxsize=32)
def rehearsing_once(controller: RuleController) -> RuleController:
    """Return a controller without its foresight that rehearses at the start only, see `rehearsing`."""
    return _with(controller, _without(controller, "foresight", "rehearsal_period_s"))


def _without(controller: RuleController, *prefixes: str) -> dict[str, str]:
    """Return a controller's attributes without those whose names have these prefixes."""
    attributes = controller.fuzzy.attributes if controller.fuzzy is not None else ()
    return {name: value for name, value in attributes if not name.startswith(prefixes)}


def _with(controller: RuleController, attributes: dict[str, str]) -> RuleController:
    """Return a controller with these attributes in place of its own."""
    if controller.fuzzy is None:
        return controller
    return from_fuzzy(replace(controller.fuzzy, attributes=tuple(attributes.items())))
