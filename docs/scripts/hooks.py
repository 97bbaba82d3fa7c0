"""What the site holds beside the pages of this folder.

Pages that live elsewhere in the repository, one page of API reference for each folder of the packages, and
what ``python -m docs build`` made of real runs.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from pipeline.command_line.guide import table
from pipeline.evaluation.assurance.quantities import SHIPPED
from pipeline.flight.state.signals import CONSTANTS, SIGNALS
from pipeline.settings.schema import descriptions, in_code, of_group, rows_of, tables

PROJECT = Path(__file__).resolve().parents[2]
#: made by ``python -m docs build``
MADE = PROJECT / "build" / "docs"
#: of recordings
SCHEMA = PROJECT / "telemetry" / "file" / "schema" / "inspection.proto"
PACKAGES = ("fis_tools", "telemetry", "pipeline", "plain_files")
#: where pages that live elsewhere stand in the site
ELSEWHERE = {
    "CHANGELOG.md": "changes.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "SUPPORT.md": "support.md",
    "telemetry/README.md": "reference/recordings.md",
}
#: folders that serve the commands, and the twins behind a flight: nothing to import
INTERNAL = {
    "fis_tools.commands",
    "pipeline.command_line",
    "pipeline.flight.period",
    "pipeline.report",
    "pipeline.report.figures",
    "pipeline.run",
    "pipeline.stages",
    "telemetry.file.schema",
}
#: modules of the same kind, beside such folders
INTERNAL_MODULES = {"commands"}
#: pages that the search puts before others: a word as short as C begins many words of all pages
SOUGHT = {"how-to/exchange-files.md"}
#: what stands at an address whose page went into another; mkdocs-redirects would bring a second mkdocs
MOVED = '<meta charset="utf-8"><meta http-equiv="refresh" content="0; url={0}"><a href="{0}">Moved</a>'
HEADINGS, *CHOICES = table()
#: tables that stand on pages where a comment of Markdown has their name
TABLES: dict[str, tuple[tuple[str, ...], list[tuple[str, ...]]]] = {
    "signals": (
        ("signal", "unit", "meaning", "formula"),
        [
            (f"`{name}`", each.unit, each.description, each.formula and f"`{each.formula}`")
            for name, each in SIGNALS.items()
        ],
    ),
    "choices": (tuple(HEADINGS[:-1]), [(f"`{name}`", *figures[:-1]) for name, *figures in CHOICES]),
    "quantities": (
        ("quantity", "unit", "meaning"),
        [(f"`{name}`", each.unit, each.description) for name, each in SHIPPED.items()],
    ),
    "constants": (
        ("constant", "meaning"),
        [(f"`{name}`", each.description) for name, each in CONSTANTS.items()],
    ),
}
#: where the page on adding has a patch
PATCH = re.compile(r"<!-- patch ([a-z-]+) -->")
#: a link of Markdown: its target, and its place on the page
LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Complete the navigation by the API reference."""
    for package in PACKAGES:
        pages = [{name: uri} for name, uri, _ in api_pages() if name.partition(".")[0] == package]
        section(config.nav, "Python").append({package: pages})
    return config


def section(nav: list[Any], title: str) -> Any:
    """Return the entries of a section, wherever in the navigation it is; None where it is not."""
    for entry in nav:
        for name, inside in entry.items() if isinstance(entry, dict) else ():
            if name == title:
                return inside
            if isinstance(inside, list) and (children := section(inside, title)) is not None:
                return children
    return None


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what the folder of pages does not hold."""
    for path, uri in ELSEWHERE.items():
        text = (PROJECT / path).read_text(encoding="utf-8")
        files.append(File.generated(config, uri, content=relinked(_without_dead_links(text), path, uri)))
    for _, uri, text in api_pages():
        files.append(File.generated(config, uri, content=text))
    for path in sorted(path for path in MADE.rglob("*") if path.suffix in {".html", ".md", ".png"}):
        uri = path.relative_to(MADE).as_posix()
        files.append(File.generated(config, uri, abs_src_path=os.fspath(path)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fill tables and patches in, and let links to pages that live elsewhere lead to them in the site."""
    if page.file.src_uri in SOUGHT:
        page.meta["search"] = {"boost": 2}
    markdown = relinked(markdown, f"docs/{page.file.src_uri}", page.file.src_uri)
    for name, (head, rows) in TABLES.items():
        lines = (f"| {' | '.join(row)} |" for row in (head, ("---",) * len(head), *rows))
        markdown = markdown.replace(f"<!-- {name} -->", "\n".join(lines))
    for name, section in (("keys", tables_of_keys), ("messages", messages)):
        if (marker := f"<!-- {name} -->") in markdown:
            markdown = markdown.replace(marker, section())
    return PATCH.sub(lambda named: _patch(named[1]), markdown)


def _patch(name: str) -> str:
    """Return the patch that adds something, as a block."""
    text = (PROJECT / "docs" / "how-to" / f"add-a-{name}.diff").read_text(encoding="utf-8")
    return f"```diff\n{text}```"


def on_page_content(html: str, **_: Any) -> str:
    """Give each cell of a table but the first of its row the head of its column, for narrow screens."""
    return re.sub(r"<table>.*?</table>", _with_heads, html, flags=re.DOTALL)


def on_post_build(config: MkDocsConfig) -> None:
    """Let each old address, as `extra.moved` lists them, lead to the page and the heading that stand for it.

    Raises
    ------
    PluginError
        Where the site lacks the page or the heading.
    """
    site = Path(config.site_dir)
    for old, new in config.extra["moved"].items():
        page, _, heading = new.replace(".md", ".html").partition("#")
        target = site / page
        if not target.is_file() or (heading and f'id="{heading}"' not in target.read_text(encoding="utf-8")):
            raise PluginError(f"mkdocs.yml: extra.moved leads from {old} to {new}, which the site lacks")
        path = (site / old).with_suffix(".html")
        path.parent.mkdir(parents=True, exist_ok=True)
        address = os.path.relpath(target, path.parent) + (heading and f"#{heading}")
        path.write_text(MOVED.format(address), encoding="utf-8")


def _with_heads(table: re.Match[str]) -> str:
    titles = re.findall(r"<th\b[^>]*>(.*?)</th>", table[0], re.DOTALL)
    heads = [re.sub(r"<[^>]+>", "", title).replace('"', "&quot;") for title in titles]

    def headed(row: re.Match[str]) -> str:
        columns = iter(heads)

        def cell(tag: re.Match[str]) -> str:
            head = next(columns, "")
            return f'<td data-head="{head}"{tag[1]}>' if head and head != heads[0] else tag[0]

        return re.sub(r"<td((?: [^>]*)?)>", cell, row[0])

    return re.sub(r"<tr>.*?</tr>", headed, table[0], flags=re.DOTALL)


def tables_of_keys() -> str:
    """Return a section for each group of keys."""
    parts = []
    for group, keys in tables().items():
        about = descriptions().get(group, "") if group else "The run, and the clocks of its flights."
        shared = of_group(group)
        if shared and not shared.is_of_stages:
            about += f" Keys other than `{'`, `'.join(shared.keys)}` only with {in_code([shared])}."
        table = ["key|default|range|meaning", "---|---|---|---", *map("|".join, rows_of(group, keys))]
        parts.append(f"## {group or 'Run and clocks'}\n\n{about}\n\n" + "\n".join(table) + "\n")
    return "\n".join(parts)


def messages() -> str:
    """Return a section for each kind of message in the schema of recordings, from its comments."""
    lines: list[str] = []
    said: list[str] = []
    for line in SCHEMA.read_text(encoding="utf-8").splitlines():
        if line.lstrip().startswith("//"):
            said.append(line.lstrip(" /"))
            continue
        words, said = " ".join(said), []
        if message := re.fullmatch(r"message (\w+) {", line):
            topic, _, rest = words.removeprefix("Topic ").partition(", ")
            lines += ["", f"### `{topic}` · `inspection.{message[1]}`", rest[:1].upper() + rest[1:]]
            lines += ["", "| field | type | meaning |", "|---|---|---|"]
        elif field := re.fullmatch(r"  ((?:repeated |optional )?\w+) (\w+) = \d+;", line):
            lines.append(f"| `{field[2]}` | {field[1]} | {words} |")
    return "\n".join(lines)


def _without_dead_links(text: str) -> str:
    """Return a page of the repository's root without links to files that the site does not hold."""

    def kept(link: re.Match[str]) -> str:
        target = link[2]
        is_held = "://" in target or target in ELSEWHERE or target.endswith((".md", ".png"))
        return link[0] if is_held or target.startswith("#") else link[1]

    return re.sub(r"\[([^\]]+)\]\(([^)\s]+)\)", kept, text)


def relinked(text: str, path: str, uri: str) -> str:
    """Return a page that stands at ``path`` of the repository with its links as from ``uri`` of the site."""

    def replaced(link: re.Match[str]) -> str:
        target, heading = link[1], link[2] or ""
        if "://" in target:
            return link[0]
        origin = os.path.normpath(PurePosixPath(path).parent / target)
        inside = ELSEWHERE.get(origin, origin.removeprefix("docs/"))
        return f"]({os.path.relpath(inside, PurePosixPath(uri).parent)}{heading})"

    return LINK.sub(replaced, text)


def api_pages() -> Iterator[tuple[str, str, str]]:
    """Yield the name, place and text of each page of the API reference: one for each folder of modules."""
    for package in PACKAGES:
        for folder in sorted(path.parent for path in (PROJECT / package).rglob("__init__.py")):
            name = ".".join(folder.relative_to(PROJECT).parts)
            if name in INTERNAL:
                continue
            modules = sorted(
                path.stem
                for path in folder.glob("*.py")
                if not path.stem.startswith("_") and path.stem not in INTERNAL_MODULES
            )
            # a search finds guides first
            head = "---\nsearch: {boost: 0.001}\n---\n"
            text = f"{head}# {name}\n\n::: {name}\n    options: {{show_root_heading: false}}\n\n"
            yield (
                name,
                f"reference/api/{name}.md",
                text + "".join(f"::: {name}.{each}\n\n" for each in modules),
            )
