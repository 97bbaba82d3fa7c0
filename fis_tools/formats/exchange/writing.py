"""Systems written for other programs: a template for each form, filled in with words of that form."""

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any

from fis_tools.formats.exchange import methods
from fis_tools.formats.exchange.carried import comment
from fis_tools.formats.exchange.dialect import Dialect, Expressed, express, only_system
from fis_tools.formats.exchange.files import Written
from fis_tools.formats.exchange.foreign import RAMPS, TABLES
from fis_tools.formats.exchange.losses import losses
from fis_tools.formats.templates import rendered
from fis_tools.model import Formula, FuzzyController, FuzzySystem, Linear, Ramp, Rule, Sampled, Term, Variable
from fis_tools.model.shape import Format


def written(
    controller: FuzzyController,
    dialect: Dialect,
    template: str,
    facts: Callable[[Expressed], dict[str, Any]],
    limited_support: Callable[[FuzzySystem], Iterable[str]] = lambda _: (),
) -> Written:
    """Write a controller with one system.

    Parameters
    ----------
    controller : FuzzyController
    dialect : Dialect
    template : str
        Asks for the `system` as the format expresses it, the comment that is `carried`, the operators and
        defuzzifiers, the `blocks` of rules, and what `facts` adds.
    facts : callable
        What only this format asks for.
    limited_support : callable
        What only some readers of the format understand, in sentences.

    Raises
    ------
    fis_tools.formats.exchange.antecedents.NotExpressible
        If the format cannot say what the system computes.
    fis_tools.model.validate.InvalidSystem
        If something is wrong with the controller.
    """
    carried = comment(controller)
    expressed = express(only_system(controller, dialect), dialect)
    words = {name: getattr(methods, name) for name in ("AND", "OR", "AGGREGATIONS", "DEFUZZIFIERS", "HEDGES")}
    text = rendered(
        f"exchange/{template}",
        system=expressed.system,
        carried=carried,
        blocks=_blocks(expressed.system),
        **words,
        **facts(expressed),
    )
    return Written(text, (*losses(controller, expressed, dialect), *limited_support(expressed.system)))


def _blocks(system: FuzzySystem) -> list[tuple[str, str, list[tuple[int, Rule]]]]:
    """Return the rules, numbered, in blocks of one operator for `and` and one for `or`."""
    groups = groupby(
        enumerate(system.rules, start=1),
        key=lambda numbered: (system.and_operator_of(numbered[1]), system.or_operator_of(numbered[1])),
    )
    return [(*operators, list(rules)) for operators, rules in groups]


def term_words(variable: Variable, term: Term, file_format: Format) -> tuple[str, list[str]]:
    """Return the word of a term that a format has one for, and its numbers as they are written."""
    shape = term.membership
    match shape:
        case Sampled(values):
            points = zip(variable.universe.tolist(), values, strict=True)
            return TABLES[file_format], [repr(float(number)) for point in points for number in point]
        case Formula(text):
            return shape.entry.words[file_format][0], [text]
        case Ramp(start, end):
            return RAMPS[file_format], [repr(float(start)), repr(float(end))]
        case Linear(coefficients, constant):
            numbers = (*coefficients, constant)
            return shape.entry.words[file_format][0], [repr(float(number)) for number in numbers]
    word, *order = shape.entry.words[file_format]
    return word, [repr(float(getattr(shape, name))) for name in order or shape.entry.kinds]
