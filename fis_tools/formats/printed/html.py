"""Fuzzy systems as HTML: terms and rule tables, as a page of their own or a part of one."""

from collections.abc import Mapping, Sequence
from html import escape

from fis_tools.model import FuzzyController, FuzzySystem, Variable
from fis_tools.words.ranking import Floats, ranked
from fis_tools.words.text import (
    extent_words,
    number,
    rule_tables,
    sentences,
    shape_words,
    summary,
    with_unit,
)

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; }}
table {{ border-collapse: collapse; margin: 1rem 0; display: block; overflow-x: auto; }}
caption {{ text-align: left; padding: .3rem 0; }}
th, td {{ border: 1px solid #8886; padding: .3rem .6rem; text-align: left; vertical-align: top; }}
th {{ font-weight: 600; background: #8881; }}
td.number {{ text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }}
@media print {{ body {{ margin: 0; max-width: none; font-size: 10pt; }} table {{ display: table; }}
tr {{ break-inside: avoid; }} thead {{ display: table-header-group; }} }}
</style>
</head>
<body>
{body}</body>
</html>
"""


def write(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as a page that needs nothing but itself.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    importance : mapping, optional
        How much each rule matters, as for `fis_tools.words.ranking.ranked`: adds the rules in this order.
    """
    return _PAGE.format(title=escape(controller.name), body=fragment(controller, importance))


def fragment(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as a part of a page, a section a system, without styles; arguments as of `write`."""
    lines = [f"<h1>{escape(controller.name)}</h1>"]
    facts = [*controller.attributes, *controller.provenance]
    if facts:
        rows = "".join(f"<tr>{_head('row', key)}<td>{escape(value)}</td></tr>" for key, value in facts)
        lines.append(f"<table><caption><strong>Facts</strong></caption><tbody>{rows}</tbody></table>")
    for system in controller.systems:
        lines += ["<section>", *_system_lines(system, importance), "</section>"]
    return "\n".join(lines) + "\n"


def _system_lines(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> list[str]:
    lines = [f"<h2>{escape(system.name)}</h2>", f"<p>{escape(summary(system))}.</p>", "<h3>Variables</h3>"]
    for kind, variables in (("Input", system.inputs), ("Output", system.outputs)):
        lines += [_variable_table(kind, variable) for variable in variables]
    lines.append("<h3>Rules</h3>")
    tables = rule_tables(system)
    output = system.outputs[0].name
    for title, rows in tables or []:
        lines.append(_rows(output, f" where {title}" if title else "", rows))
    is_ranked = importance is not None and system.name in importance
    if tables is None or is_ranked:
        lines.append(_rule_list(system, importance if is_ranked else None))
    return lines


def _variable_table(kind: str, variable: Variable) -> str:
    extent = f"from {extent_words(variable)}"
    default = f"; {number(variable.default)} when no rule fires" if variable.default is not None else ""
    about = f". {variable.description}" if variable.description else ""
    rows = [[term.name, shape_words(term)] for term in variable.terms]
    heads = ["term", "membership function"]
    return _rows(f"{kind} {with_unit(variable)}", f": {extent}{default}{about}", [heads, *rows])


def _rows(name: str, about: str, rows: Sequence[Sequence[str]]) -> str:
    """Set a table whose first row and first column are heads."""
    first, *rest = rows
    heads = "".join(_head("col", cell) for cell in first)
    body = "".join(
        f"<tr>{_head('row', row[0])}{''.join(f'<td>{escape(cell)}</td>' for cell in row[1:])}</tr>\n"
        for row in rest
    )
    return (
        f"<table><caption><strong>{escape(name)}</strong>{escape(about)}</caption>\n"
        f"<thead><tr>{heads}</tr></thead>\n"
        f"<tbody>\n{body}</tbody></table>"
    )


def _rule_list(system: FuzzySystem, importance: Mapping[str, Floats] | None) -> str:
    told = sentences(system)
    heads = ["rule", *(["importance"] if importance is not None else []), "sentence"]
    body = ""
    for entry in ranked(system, importance):
        share = f'<td class="number">{escape(entry.importance_words)}</td>' if importance is not None else ""
        sentence = escape(told[entry.number - 1])
        body += f"<tr>{_head('row', str(entry.number))}{share}<td>{sentence}</td></tr>\n"
    caption = "Rules" if importance is None else "Rules, those that matter most first"
    return (
        f"<table><caption><strong>{caption}</strong></caption>\n"
        f"<thead><tr>{''.join(_head('col', word) for word in heads)}</tr></thead>\n"
        f"<tbody>\n{body}</tbody></table>"
    )


def _head(scope: str, words: str) -> str:
    return f'<th scope="{scope}">{escape(words)}</th>'
