"""`audit`: what a reviewer should look at before signing."""

import shutil
from dataclasses import fields, replace
from typing import Literal

from fis_tools.commands.arguments import AskedAlong, UserMistake, analysing, assignments
from fis_tools.document import data, text
from fis_tools.findings.audit import Severity, Thresholds, audit
from fis_tools.findings.audit.report import SCHEMA, SCHEMA_VERSION
from fis_tools.model.validate import nearest
from fis_tools.source import read_controller

#: A terminal of another width than this is taken as this.
NARROWEST, WIDEST = 60, 120


def run(
    asked: AskedAlong,
    *,
    reference: str | None = None,
    json: bool = False,
    fail_on: Literal["note", "warning", "serious"] | None = None,
    thresholds: str = "",
) -> int:
    """List what a reviewer should know: gaps, slips, idle rules.

    The exit status is 0; with --fail-on it is 1 where there is a finding so severe or worse; a mistake
    gives 2.

    For example:

        python -m fis_tools audit controller.yaml
        python -m fis_tools audit controller.yaml --flights episodes/*.mcap --fail-on serious
        python -m fis_tools audit episodes/best.mcap --json > audit.json
        python -m fis_tools audit tuned.yaml --reference untuned.yaml
        python -m fis_tools audit controller.yaml --thresholds coverage=0.5,look_alike=0.6

    Thresholds, most of them shares from 0 to 1:

    - fired (0.05): a rule counts as fired, and a value as covered at all, from this strength on
    - coverage (0.2): each value should belong to a term, and each input to a rule, this much
    - look_alike (0.7): terms that share more of their areas mean the same
    - possibility (0.85): terms that hold together by more are hard to tell apart
    - inside (0.9): a term of which more lies under another one says little of its own
    - zero (0.8): how much 0 should belong to a term called zero
    - jump (0.55): neighbouring rules should differ by no more of the output's range
    - against (0.25): up to this share of steps against the rest, an input counts as meant to act one way
    - asymmetry (0.1): no more of the pairs of rules should break a symmetry that the others have
    - reversal (0.1): the least way back of an output that counts, of its range
    - consistency (0.3): the least consistency of a rule
    - reach (0.5): an output should reach this much of its range
    - partition (0.3): the least GM3M of a variable, against --reference or an even partition
    - clipped (0.05): an input should lie outside its range in no more of the inferences
    - dead (0.5): no more of the rules should never fire on flights
    - dominant (0.6): no rule should lead, or matter, by more
    - idle (0.001): a rule should move an output by more of its range on average
    - rules (60): the most rules of a system
    - terms (9): the most terms of a variable

    Parameters
    ----------
    reference
        compare terms with those of this controller, such as before tuning [default: an even partition]
    json
        print it for programs (schema fuzzy-audit, version 2)
    fail_on
        end with status 1 if there is a finding so severe or worse
    thresholds
        from where on something is a finding: NAME=NUMBER,NAME=NUMBER
    """
    controller = asked.read()
    compared = None if reference is None else read_controller(reference, asked.trust)
    limits = _thresholds(thresholds)
    try:
        with analysing(controller):
            found = audit(controller, asked.flown(controller), limits, compared)
    except UserMistake:
        raise
    except ValueError as error:
        raise UserMistake(f"{error}; give a --reference of the same systems") from error
    if json:
        print(data.write(SCHEMA, SCHEMA_VERSION, found.plain()), end="")
    else:
        width = min(WIDEST, max(NARROWEST, shutil.get_terminal_size((text.WIDTH, 24)).columns))
        print(text.write(found.document(), width), end="")
    return 0 if fail_on is None else int(bool(found.at_least(Severity[fail_on.upper()])))


def _thresholds(words: str) -> Thresholds:
    values = assignments(words)
    defaults = {field.name: field.default for field in fields(Thresholds)}
    for name in values:
        if name not in defaults:
            raise UserMistake(f"there is no threshold {name!r}; {nearest(name, defaults)}")
        if values[name] < 0.0:
            raise UserMistake(f"the threshold {name!r} is below 0; give one that is not")
    return replace(Thresholds(), **values)  # type: ignore[arg-type]
