"""Fly what the tables of results are of, and write their figures: ``python -m docs tables``.

A table behind a line such as ``<!-- table: headline -->`` holds figures of one run, which is kept in
``docs/results``. The command flies that run anew, and refuses if a printed figure comes out differently;
``--write`` keeps the new run and writes its figures. Folders of runs that were flown already may be given.
Cells of other rows and columns stay as they are.
"""

import argparse
import csv
import io
import json
import re
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.command_line.cli import main as pipeline
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named, sha256_of
from pipeline.evaluation.comparison import PLANNED, SUCCESS, ComparisonRow, percent_ahead, row_of, spread
from pipeline.run import artifacts, configuration

PROJECT = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "docs/reference/results.md", "docs/explanation/foresight.md")
#: by which help recommends controllers, and what it calls a setting of the Sun
CHOICES, SUNS = "pipeline/command_line/choosing.csv", {"any": "random", "fixed": "fixed"}
KEPT = PROJECT / "docs" / "results"
MARK = re.compile(r"^<!-- table: (.+?) -->\n\n?((?:\|.*\n)+)", re.MULTILINE)
LINK = re.compile(r"\[([^]]*)\]\([^)]*\)")
#: in the name of a row, how much of its fuel rules fire, or do not
BY_RULES = re.compile(r"(?<=rules fire )[\d.]+ %")
AHEAD = re.compile(r"(?<=burn )[\d.]+ %(?= of its fuel)")

#: the cell of a row, and of the same controller under the safety layer, if it flew under one
Cell = Callable[[ComparisonRow, ComparisonRow | None], str]


def of_share(name: str, *, has_interval: bool = False) -> Cell:
    """Return what writes a share in per cent, with its interval unless no flight counts."""

    def cell(row: ComparisonRow, guarded: ComparisonRow | None) -> str:
        measure = row.summary[name]
        text = f"{100 * measure['fraction']:.1f} %"
        if has_interval and (measure["count"] or row.source == PLANNED):
            text += f" ({100 * measure['low']:.1f}–{100 * measure['high']:.1f})"
        return text if guarded is None else f"{text} [{100 * guarded.summary[name]['fraction']:.1f}]"

    return cell


def _fuel(row: ComparisonRow, guarded: ComparisonRow | None) -> str:
    text = spread(row.summary["delta_v_m_s"], 3)
    return text if guarded is None else f"{text} [{guarded.summary['delta_v_m_s']['mean']:.3f}]"


def _mean_fuel(row: ComparisonRow, _guarded: ComparisonRow | None) -> str:
    return f"{row.summary['delta_v_m_s']['mean']:.3f}"


def _rate(row: ComparisonRow, _guarded: ComparisonRow | None) -> str:
    return spread(row.summary["inspection_rate_percent"], 2)


def _times(row: ComparisonRow, _guarded: ComparisonRow | None) -> str:
    return "1" if row.source == PLANNED else f"{(row.times or {})['times_optimum']['mean']:.1f}"


def _times_as_seen(row: ComparisonRow, _guarded: ComparisonRow | None) -> str:
    return "1" if row.source == PLANNED else f"{(row.times or {})['times_optimum_as_seen']['mean']:.2f}"


def _under_the_layer(_row: ComparisonRow, guarded: ComparisonRow | None) -> str:
    if guarded is None:
        return ""
    fuel, outside = guarded.summary["delta_v_m_s"]["mean"], guarded.summary["violated"]["fraction"]
    return f"{fuel:.3f} m/s, {100 * outside:.1f} % outside"


def _fired_by_rules(row: ComparisonRow, _guarded: ComparisonRow | None) -> str:
    return f"{100.0 - percent_ahead(row.summary):.2g} %".replace("1e+02", "100")


@dataclass(frozen=True)
class Table:
    """A table of a page: the experiment and the Sun of its flights, and what writes each column."""

    experiment: str
    sun: str
    columns: Mapping[str, Cell]


_WHOLE: Mapping[str, Cell] = {
    "delta-v (m/s)": _fuel,
    "inspection rate (%)": _rate,
    "success rate": of_share(SUCCESS, has_interval=True),
    "outside the limits": of_share("violated", has_interval=True),
    "times the best plan found": _times,
}
TABLES = {
    "headline": Table(
        "headline",
        "random",
        {
            "delta-v (m/s)": _mean_fuel,
            "success": of_share(SUCCESS),
            "outside the limits": of_share("violated"),
            "stays an orbit": of_share("stays_orbit"),
            "with the safety layer": _under_the_layer,
        },
    ),
    "reproduce, Sun fixed": Table("reproduce", "fixed", _WHOLE),
    "reproduce, Sun anywhere": Table("reproduce", "random", _WHOLE),
    "foresight": Table(
        "reproduce",
        "random",
        {
            "delta-v (m/s)": _mean_fuel,
            "success": of_share(SUCCESS),
            "outside 15–200 m": of_share("violated"),
            "share of fuel burnt by pushes that rules fire": _fired_by_rules,
            "fuel relative to the best plan that sees as many points (other 50 starts)": _times_as_seen,
        },
    ),
}


def main() -> None:
    """Fly what the tables are of; write their figures, or refuse those that differ."""
    parser = argparse.ArgumentParser(
        prog="python -m docs tables", description="Fly what tables of results are of; refuse what differs."
    )
    parser.add_argument("--write", action="store_true", help="keep the new runs, and write their figures")
    parser.add_argument("folders", nargs="*", type=Path, help="runs that were flown already")
    options = parser.parse_args()
    names = list(dict.fromkeys(table.experiment for table in TABLES.values()))
    there = {configuration.read(folder)["name"]: folder for folder in options.folders}
    runs = {name: run_of(name, there.get(name)) for name in names}
    if options.write:
        for name, run in runs.items():
            path_of(name).write_text(json.dumps(run, indent=1) + "\n", encoding="utf-8")
    differing = 0
    for page, write in {**dict.fromkeys(PAGES, written), CHOICES: chosen}.items():
        path = PROJECT / page
        text = path.read_text(encoding="utf-8")
        again = write(text, runs)
        if options.write:
            path.write_text(again, encoding="utf-8")
        for old, new in zip(text.splitlines(), again.splitlines(), strict=True):
            if old != new and not options.write:
                differing += 1
                sys.stderr.write(f"{page} prints\n  {old}\nand its command gives\n  {new}\n")
    sys.exit(f"{differing} rows differ; --write puts them right" if differing else 0)


def path_of(name: str) -> Path:
    """Return the file that keeps the run of an experiment."""
    return KEPT / f"{name}.json"


def run_of(name: str, folder: Path | None = None) -> dict[str, Any]:
    """Return the comparison of an experiment, flown unless a folder has it, and its controllers' hashes."""
    experiment = compose_experiment([f"+experiment={name}"]).experiment
    with tempfile.TemporaryDirectory() as scratch:
        run = folder or Path(scratch) / "run"
        words = [f"+experiment={name}", "stages=[compare]", f"hydra.run.dir={run}"]
        if folder is None and (code := pipeline(words)):
            sys.exit(code)
        comparison = json.loads((run / artifacts.COMPARISON).read_text(encoding="utf-8"))
    if (comparison["seed"], comparison["num_cases"]) != (experiment.seed, experiment.monte_carlo.num_cases):
        sys.exit(f"{run} has flown other starts than +experiment={name}")
    return {"controllers": hashes(experiment.compare.controllers), "comparison": comparison}


def hashes(names: Sequence[str]) -> dict[str, str | None]:
    """Return the SHA-256 of fuzzy controllers, by name."""
    mission = compose_experiment(["+experiment=evaluate"]).experiment.mission
    return {name: sha256_of(named(name, mission)) for name in names}


def written(page: str, runs: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a page whose tables have the figures of runs, by experiment."""

    def table(match: re.Match[str]) -> str:
        kind = TABLES[match[1]]
        rows = [row_of(entry) for entry in runs[kind.experiment]["comparison"]["rows"]]
        of_sun = [row for row in rows if row.sun == kind.sun]
        plain = {_name(row): row for row in of_sun if row.safety == "none"}
        guarded = {_name(row): row for row in of_sun if row.safety != "none"}
        head, rule, *lines = match[2].splitlines()
        columns = [kind.columns.get(LINK.sub(r"\1", cell)) for cell in _cells(head)]
        # a later row of the same controller is of other flights
        written_lines = [_line(line, columns, plain, guarded) for line in lines]
        return match[0].replace(match[2], "\n".join([head, rule, *written_lines]) + "\n")

    return MARK.sub(table, page)


def chosen(table: str, runs: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the table by which ``--help controller`` recommends controllers, with the figures of runs."""
    head, *lines = csv.reader(table.splitlines())
    flown = {
        (row.controller, row.sun, row.safety == "none"): row
        for row in map(row_of, runs["reproduce"]["comparison"]["rows"])
    }
    columns: tuple[Cell, ...] = _mean_fuel, of_share(SUCCESS), of_share("violated"), _under_the_layer
    for line in lines:
        name, _, world, sun, *cells, purpose, page = line
        row = flown.get((name, SUNS[sun], True))
        if world == "paper" and row is not None:
            guarded = flown.get((name, SUNS[sun], False))
            figures = [
                column(row, guarded if column is _under_the_layer else None) if cell else ""
                for column, cell in zip(columns, cells, strict=True)
            ]
            purpose = BY_RULES.sub(f"{100.0 - percent_ahead(row.summary):.2g} %", purpose)
            line[4:] = [*figures, purpose, page]
    made = io.StringIO()
    csv.writer(made, lineterminator="\n").writerows([head, *lines])
    return made.getvalue()


def _name(row: ComparisonRow) -> str:
    return "best plans found" if row.source == PLANNED else row.controller


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def _line(
    line: str,
    columns: list[Cell | None],
    plain: dict[str, ComparisonRow],
    guarded: Mapping[str, ComparisonRow],
) -> str:
    """Return a line of a table with its figures; as it is if its first cell names nothing that is left."""
    label, *cells = _cells(line)
    name = next((name for name in plain if f"`{name}`" in label or label.startswith(name)), None)
    if name is None:
        return line
    row = plain.pop(name)
    ahead = percent_ahead(row.summary)
    label = BY_RULES.sub(f"{100.0 - ahead:.2g} %", AHEAD.sub(f"{ahead:.1f} %", label))
    filled = []
    for column, cell in zip(columns[1:], cells, strict=True):
        # a page leaves out the layer where it changes nothing
        shows_layer = "[" in cell or column is _under_the_layer
        with_layer = guarded.get(name) if shows_layer else None
        filled.append(column(row, with_layer) if column and cell else cell)
    return re.sub("  +", " ", "| " + " | ".join([label, *filled]) + " |")


if __name__ == "__main__":
    main()
