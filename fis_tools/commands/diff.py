"""`diff`: what changed from one controller to another."""

from importlib import import_module
from pathlib import Path

from fis_tools.commands.arguments import (
    AskedAlong,
    Output,
    UserMistake,
    analysing,
    chosen,
    flown_inputs,
    write,
)
from fis_tools.document import data
from fis_tools.findings.difference import difference
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller


def run(
    asked: AskedAlong, after: str, *, json: bool = False, exit_code: bool = False, output: Output = None
) -> int:
    """Tell what changed from one controller to another.

    Terms are told with how far they moved and how much of their area is still shared; rules are compared by
    what they ask for, whatever their order; outputs are compared over 4096 inputs spread over the ranges
    (fewer for outputs of more than 48,000 points), and along --flights.

    The exit status is 0; with --exit-code it is 1 where something changed; a mistake gives 2.

    For example:

        python -m fis_tools diff before.yaml after.yaml
        python -m fis_tools diff before.yaml outputs/train/20250101-120000-000000 --flights episodes/*.mcap
        python -m fis_tools diff before.yaml after.fis --exit-code
        python -m fis_tools diff before.yaml after.yaml -o diff.html

    Parameters
    ----------
    after
        the controller that CONTROLLER is compared with
    json
        print it for programs (schema fuzzy-difference, version 1)
    exit_code
        end with status 1 if anything changed
    output
        a page (.html), or the same as is printed [default: printed]
    """
    is_page = not json and Path(output or "").suffix.lower() in {".html", ".htm"}
    if is_page:  # what pictures need is missed before anything is computed
        import_module("fis_tools.render")
    old, new = (read_controller(path, asked.trust) for path in (asked.controller, after))
    old, new = _limited(old, new, asked.system)
    samples = flown_inputs(asked.flights, new, asked.all_periods)
    with analysing(old, new):
        found = difference(old, new, samples, (asked.controller, after))
    if json:
        content = data.write("fuzzy-difference", 1, found.plain())
    else:
        content = found.html() if is_page else found.text()
    write(output, content)
    return int(exit_code and not found.is_empty)


def _limited(
    before: FuzzyController, after: FuzzyController, name: str | None
) -> tuple[FuzzyController, FuzzyController]:
    """Keep the system that is asked for in both, where one is."""
    if name is None:
        return before, after
    has = [any(system.name == name for system in one.systems) for one in (before, after)]
    if any(has) and not all(has):
        which = after if has[0] else before
        raise UserMistake(
            f"controller {which.name!r} has no system {name!r}; leave --system out to see all changes"
        )
    return chosen(before, name), chosen(after, name)
