"""A difference as a self-contained page: tables, and pictures of the terms."""

from collections.abc import Sequence
from html import escape

from fis_tools.findings.difference import pictures, surfaces, words
from fis_tools.findings.difference.change import Fact, Source, SystemDifference, VariableChange
from fis_tools.formats.printed.html import POLICY
from fis_tools.model.weighing import has_sets
from fis_tools.words.text import number, shape_words, with_unit

_STYLE = """\
.difference { --ink: light-dark(#1b1f24, #e8ebee); --muted: light-dark(#57606b, #a3adb8);
--rule: light-dark(#c2c9d1, #47505a); --panel: light-dark(#f5f7f9, #1c2126);
--gone: light-dark(#a02018, #ff9a90); --come: light-dark(#00623f, #5fdcae);
--mark: light-dark(#fff3d0, #3d3216); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
.difference table { border-collapse: collapse; margin: .8rem 0 1.4rem; font-size: .92rem; }
.difference .wide { overflow-x: auto; }
.difference caption { text-align: left; padding: .3rem 0; color: var(--muted); }
.difference th, .difference td { border: 1px solid var(--rule); padding: .3rem .6rem; text-align: left;
vertical-align: top; }
.difference thead th, .difference th[scope="row"] { font-weight: 600; background: var(--panel); }
.difference td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.difference td.changed { background: var(--mark); box-shadow: inset 0 0 0 2px var(--ink); }
.difference td.same { color: var(--muted); }
.difference del { color: var(--gone); display: block; }
.difference ins { color: var(--come); display: block; text-decoration: none; font-weight: 600; }
.difference .inline del, .difference .inline ins { display: inline; }
.difference .inline ins::before { content: " → "; color: var(--muted); font-weight: 400; }
.difference .note { color: var(--muted); font-size: .9rem; }
.difference td { overflow-wrap: anywhere; }
.difference .surfaces { margin: .8rem 0 1.4rem; } .difference .surfaces img { width: 100%; height: auto; }
.difference figcaption { color: var(--muted); font-size: .9rem; }
.difference svg.terms { display: block; width: 100%; max-width: 46rem; height: auto; }
.difference svg polyline { fill: none; stroke: currentColor; stroke-linejoin: round; }
.difference svg .same { opacity: .6; stroke-width: 1.1; }
.difference svg .before { stroke-width: 1.8; stroke-dasharray: 6 4; }
.difference svg .after { stroke-width: 2.4; }
.difference svg text { font-size: 13px; fill: currentColor; stroke: none; }
.difference svg .axis { stroke: var(--rule); } .difference svg .tick { color: var(--muted); font-size: 12px; }
.difference svg .gone { color: var(--gone); } .difference svg text.gone { text-decoration: line-through; }
.difference .term-0 { color: light-dark(#0072b2, #4ea9e3); }
.difference .term-1 { color: light-dark(#b84e00, #ff8b45); }
.difference .term-2 { color: light-dark(#00805d, #35cfa3); }
.difference .term-3 { color: light-dark(#a03d90, #e08ad2); }
.difference .term-4 { color: light-dark(#33373c, #d5dae0); }
.difference .term-5 { color: light-dark(#8f6400, #f3b53f); }
.difference .term-6 { color: light-dark(#2679ad, #8fd0f5); }
"""

_LEGEND = "In the pictures terms are dashed as they were, solid as they are, thin where nothing changed."
_TAGS = {"-": "del", "+": "ins"}

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
body {{ max-width: 66rem; margin: 2rem auto; padding: 0 1rem; }}
h1 {{ font-size: 1.7rem; line-height: 1.2; overflow-wrap: anywhere; }}
h2 {{ margin-top: 2.6rem; padding-top: 1rem; border-top: 2px solid #8886; }}
h3 {{ margin: 1.8rem 0 .4rem; }}
@media print {{ :root {{ color-scheme: light; }} body {{ margin: 0; max-width: none; font-size: 10pt; }}
tr, svg {{ break-inside: avoid; }} h2, h3, caption {{ break-after: avoid; }} }}
</style>
</head>
<body>
{body}</body>
</html>
"""


def write(sources: tuple[Source, Source], facts: Sequence[Fact], systems: Sequence[SystemDifference]) -> str:
    """Write a difference as a self-contained page."""
    body = fragment(sources, facts, systems)
    return _PAGE.format(policy=POLICY, title=escape(words.title(sources)), body=body)


def fragment(
    sources: tuple[Source, Source], facts: Sequence[Fact], systems: Sequence[SystemDifference]
) -> str:
    """Write a difference as a part of a page, with its styles."""
    parts = [
        f'<style>\n{_STYLE}</style>\n<main class="difference">',
        f"<h1>{escape(words.title(sources))}</h1>",
        _table(
            "", ["", "file", "hash"], [[escape(cell) for cell in row] for row in words.source_rows(sources)]
        ),
        _facts(facts),
    ]
    if not facts and all(system.is_empty for system in systems):
        parts.append("<p>Nothing changed.</p>")
    for system in systems:
        parts += ["<section>", f"<h2>{escape(system.name)}</h2>", *_system(system), "</section>"]
    return "\n".join(part for part in parts if part) + "\n</main>\n"


def _facts(facts: Sequence[Fact]) -> str:
    rows = [
        [escape(fact.what), f"<del>{escape(before)}</del><ins>{escape(after)}</ins>"]
        for fact in facts
        for before, after in [words.fact_words(fact)]
    ]
    return _table("", ["", f"before {words.TO} after"], rows, "inline") if rows else ""


def _system(system: SystemDifference) -> list[str]:
    if system.before is None or system.after is None:
        return [f"<p>{escape(words.presence(system).capitalize())}.</p>"]
    if system.is_empty:
        return ["<p>Nothing changed.</p>"]
    parts = [f"<p>{escape(words.headline(system))}.</p>", _facts(system.facts), _outputs(system)]
    parts += surfaces.draw(system)
    if any(change.terms for change in system.variables):
        parts.append(f'<p class="note">{_LEGEND}</p>')
    for change in system.variables:
        parts += _variable(change)
    if system.rules:
        parts += ["<h3>Rules</h3>", *_rules(system)]
    return parts


def _outputs(system: SystemDifference) -> str:
    """Return a table of how far the outputs changed."""
    rows = []
    for change in system.outputs:
        output = change.output
        rows.append(
            [
                escape(with_unit(output)),
                escape(f"{change.where}, {change.num_samples} inputs"),
                f"{number(change.mean)} <br>{words.percent(change.mean_share)}",
                f"{number(change.largest)} <br>{words.percent(change.largest_share)}",
                escape(words.largest_words(change) if change.largest > 0.0 else "nowhere"),
            ]
        )
    heads = ["output", "over", "moves on average", "at most", "where it moves most"]
    caption = "How far the outputs moved: in their unit, and as a share of their range"
    return _table(caption, heads, rows, numbers=(2, 3)) if rows else ""


def _variable(change: VariableChange) -> list[str]:
    head = f"{change.kind.capitalize()} {with_unit(change.variable)}"
    if change.before is None or change.after is None:
        state = "added" if change.before is None else "removed"
        rows = [[escape(term.name), escape(shape_words(term))] for term in change.variable.terms]
        return [f"<h3>{escape(head)}: {state}</h3>", _table("", ["term", "membership function"], rows)]
    parts = [f"<h3>{escape(head)}</h3>", _facts(change.facts)]
    if change.terms:
        rows = []
        for term in change.terms:
            rows.append([escape(told) for told in (words.term_name(term), *words.term_words(change, term))])
        parts += [
            pictures.draw(change) if has_sets(change.before) and has_sets(change.after) else "",
            _table("", ["term", f"membership function, before {words.TO} after", "how far"], rows),
        ]
    return parts


def _rules(system: SystemDifference) -> list[str]:
    tables = words.changed_tables(system)
    if tables is None:
        rows = []
        for change in system.rules:
            cells = "".join(
                f"<{_TAGS[sign]}>{escape(told)}</{_TAGS[sign]}>" for sign, told in words.rule_words(change)
            )
            rows.append([str(change.number), cells])
        return [_table("", ["rule", f"before {words.TO} after"], rows)]
    parts = []
    for title, heads, lines in tables:
        rows = [
            [
                escape(head),
                *(
                    f"<del>{escape(cell.before)}</del><ins>{escape(cell.after)}</ins>"
                    if cell.before != cell.after
                    else escape(cell.after)
                    for cell in cells
                ),
            ]
            for head, cells in lines
        ]
        parts.append(_table(f"where {title}" if title else "", heads, rows, "rules"))
    return parts


def _table(
    caption: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    style: str = "",
    numbers: Sequence[int] = (),
) -> str:
    """Set a table whose first column heads its rows; cells are HTML, heads are not."""
    above = f"<caption>{escape(caption)}</caption>" if caption else ""
    columns = "".join(f'<th scope="col">{escape(head)}</th>' for head in heads)
    body = ""
    for first, *cells in rows:
        body += f'<tr><th scope="row">{first}</th>'
        for place, cell in enumerate(cells, start=1):
            kind = "number" if place in numbers else ""
            if style == "rules":
                kind = "changed" if cell.startswith("<del>") else "same"
            body += f'<td class="{kind}">{cell}</td>' if kind else f"<td>{cell}</td>"
        body += "</tr>\n"
    return (
        f'<div class="wide"><table class="{style}">{above}<thead><tr>{columns}</tr></thead>\n'
        f"<tbody>\n{body}</tbody></table></div>"
    )
