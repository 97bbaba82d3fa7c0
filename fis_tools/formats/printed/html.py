"""Fuzzy systems as HTML: terms and rule tables, as a page of their own or a part of one."""

from collections.abc import Mapping, Sequence
from html import escape

from fis_tools.model import FuzzyController
from fis_tools.typing import Floats
from fis_tools.words.outline import SystemOutline, outline

#: of pages without scripts: nothing runs, and nothing is fetched but what the page carries
POLICY = (
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
    "img-src data:; base-uri 'none'; form-action 'none'\">"
)

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
{policy}
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
    """Write a controller as a page of its own; see `fis_tools.words.outline.outline` for the parameters."""
    body = fragment(controller, importance)
    return _PAGE.format(policy=POLICY, title=escape(controller.name), body=body)


def fragment(controller: FuzzyController, importance: Mapping[str, Floats] | None = None) -> str:
    """Write a controller as a part of a page, one section per system, without styles."""
    told = outline(controller, importance)
    lines = [f"<h1>{escape(told.name)}</h1>"]
    if told.facts:
        rows = "".join(f"<tr>{_head('row', key)}<td>{escape(value)}</td></tr>" for key, value in told.facts)
        lines.append(f"<table><caption><strong>Facts</strong></caption><tbody>{rows}</tbody></table>")
    for system in told.systems:
        lines += ["<section>", *_system_lines(system), "</section>"]
    return "\n".join(lines) + "\n"


def _system_lines(system: SystemOutline) -> list[str]:
    lines = [f"<h2>{escape(system.name)}</h2>", f"<p>{escape(system.summary)}.</p>", "<h3>Variables</h3>"]
    for variable in system.variables:
        about = f": from {variable.reach}" + (f". {variable.description}" if variable.description else "")
        rows = [["term", "membership function"], *variable.terms]
        lines.append(_table(f"{variable.kind.capitalize()} {variable.title}", about, rows))
    lines.append("<h3>Rules</h3>")
    for title, rows in system.tables:
        lines.append(_table(system.output, f" where {title}" if title else "", rows))
    if system.is_ranked:
        rows = [["rule", "importance", "sentence"], *map(list, system.rules)]
        lines.append(_table("Rules, those that matter most first", "", rows, number_column=1))
    elif system.lists_rules:
        rows = [["rule", "sentence"], *([place, sentence] for place, _, sentence in system.rules)]
        lines.append(_table("Rules", "", rows))
    return lines


def _table(name: str, about: str, rows: Sequence[Sequence[str]], number_column: int | None = None) -> str:
    """Set a table whose first row and first column are heads."""
    first, *rest = rows
    heads = "".join(_head("col", cell) for cell in first)
    body = ""
    for row_head, *cells in rest:
        numbers = [' class="number"' if place == number_column else "" for place in range(1, len(first))]
        told = (f"<td{kind}>{escape(cell)}</td>" for kind, cell in zip(numbers, cells, strict=True))
        body += f"<tr>{_head('row', row_head)}{''.join(told)}</tr>\n"
    return (
        f"<table><caption><strong>{escape(name)}</strong>{escape(about)}</caption>\n"
        f"<thead><tr>{heads}</tr></thead>\n"
        f"<tbody>\n{body}</tbody></table>"
    )


def _head(scope: str, words: str) -> str:
    return f'<th scope="{scope}">{escape(words)}</th>'
