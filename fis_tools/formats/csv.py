"""Rule bases as CSV: one row for each rule and consequent, for spreadsheets and data frames.

A spreadsheet takes a cell that begins with ``=``, ``+``, ``-`` or ``@`` for a formula, and runs it. Text that
does so, and is no number, gets an apostrophe before it, which spreadsheets take for "this is text".
"""

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from fis_tools.model import FuzzyController
from fis_tools.model.rule_tables import conjunction
from fis_tools.words.text import antecedent_words
from plain_files.plain_text import as_number

#: what a spreadsheet may take for the beginning of a formula
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def as_text(cell: Any) -> Any:
    """Return a cell that no spreadsheet runs as a formula."""
    # spreadsheets skip leading blanks
    is_run = isinstance(cell, str) and (cell.startswith(FORMULA) or cell.lstrip().startswith(FORMULA))
    return f"'{cell}" if is_run and as_number(cell) is None else cell


def rows_as_text(rows: Iterable[Sequence[Any]]) -> str:
    """Write rows as CSV, each cell `as_text`."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([as_text(cell) for cell in row] for row in rows)
    return text.getvalue()


def write(controller: FuzzyController) -> str:
    """Write the rules of all systems of a controller.

    Columns are ``system, rule, label``, one for each input of any system, ``antecedent`` in words, then
    ``output, term, weight``. An input's column holds the term it must have, and is empty where a rule does
    not mention it or says more than a conjunction can.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    """
    inputs = list(dict.fromkeys(v.name for system in controller.systems for v in system.inputs))
    rows = [["system", "rule", "label", *inputs, "antecedent", "output", "term", "weight"]]
    for system in controller.systems:
        for number, rule in enumerate(system.rules, start=1):
            terms = conjunction(rule.antecedent) or {}
            cells = [*(terms.get(name, "") for name in inputs), antecedent_words(rule.antecedent)]
            for c in rule.consequents:
                concluded = [c.variable, c.term, repr(float(c.weight))]
                rows.append([system.name, str(number), rule.label, *cells, *concluded])
    return rows_as_text(rows)
