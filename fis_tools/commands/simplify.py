"""`simplify`: fewer rules, terms and digits, while the outputs stay within a budget."""

from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter, Token

from fis_tools.commands.arguments import AskedAlong, Output, UserMistake, analysing, form_of, write
from fis_tools.document import data
from fis_tools.findings.simplification import Budget, simplify

SCHEMA = "fuzzy-simplification"
SCHEMA_VERSION = 1
DEFAULTS = Budget()


def _share(_kind: object, tokens: Sequence[Token]) -> float:
    """Read ``5%`` or ``0.05``."""
    word = tokens[0].value.strip()
    try:
        value = float(word.removesuffix("%")) / (100.0 if word.endswith("%") else 1.0)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise ValueError(f"{word!r} is no share from 0% to 100%; write 5% or 0.05")
    return value


Share = Annotated[float, Parameter(converter=_share)]


def run(
    asked: AskedAlong,
    *,
    max_change: Share = DEFAULTS.max_change,
    mean_change: Share = DEFAULTS.mean_change,
    look_alike: Share = DEFAULTS.look_alike,
    flights_only: bool = False,
    output: Output = None,
    json: bool = False,
) -> None:
    """Make a simpler controller that answers nearly the same.

    Steps leave out inputs, drop rules, merge terms that look alike, and round numbers. Each is measured
    against the original; what changes least goes first, until nothing more fits the budget. It holds along
    the flights that are given, and at 4,096 points spread over the whole ranges of the inputs; between them a
    change can be a little larger. With --flights-only far more can go, but what was not flown changes at
    will, and other starts are flown worse. What comes out is an ordinary controller: fly it before you trust
    it.

    For example:

        python -m fis_tools simplify controller.yaml -o simpler.yaml
        python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --max-change 2%
        python -m fis_tools simplify controller.yaml --flights episodes/*.mcap --flights-only

    Parameters
    ----------
    max_change
        the largest change of an output that is allowed, of its range: 5% or 0.05
    mean_change
        the mean change that is allowed, likewise
    look_alike
        merge terms that share so much of their areas
    flights_only
        keep the budget along the flights alone
    output
        write the simpler controller (.json, .yaml)
    json
        print the steps for programs (schema fuzzy-simplification, version 1)
    """
    form = form_of(output)
    controller = asked.read()
    samples = asked.flown(controller)
    if samples is None and flights_only:
        raise UserMistake("--flights-only needs flights; add --flights, or leave it out")
    try:
        budget = Budget(max_change, mean_change, flights_only, look_alike)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    with analysing(controller) as tell:
        found = simplify(controller, samples, budget, tell)
    if form is not None:
        write(output, form(found.controller))
    print(data.write(SCHEMA, SCHEMA_VERSION, found.plain()) if json else found.text(), end="")
