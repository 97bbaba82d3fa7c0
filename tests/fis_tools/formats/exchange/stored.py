"""Values that programs gave for files, stored with the command that made them; and the page's table of them.

``python -m tests.fis_tools.formats.exchange.stored CLASSPATH`` asks pyfuzzylite and jFuzzyLogic (compiled, at
CLASSPATH) again. Octave and fuzzylite 6 are asked by the tests themselves.
"""

import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import dialects
from fis_tools.formats.exchange import fcl, fll
from fis_tools.formats.exchange.antecedents import NotExpressible
from fis_tools.formats.exchange.fcl_words import ACCUMULATIONS, DUALS
from fis_tools.formats.serialize import loads
from fis_tools.model import FuzzySystem
from tests.fis_tools.engines import weighed_systems
from tests.fis_tools.engines.random_systems import sampled_systems
from tests.fis_tools.formats.exchange.systems import alone, without_comment

FILE = Path(__file__).with_name("programs.json")
#: Of each program, and what it is asked for in how many samples.
FILES, SAMPLES = 10, 8
LONGEST = 2500
FORMS = {"fll": fll, "fcl": fcl}


def load() -> dict[str, Any]:
    """Return the stored values by the program's name."""
    stored: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return stored


def texts(kind: str) -> Iterator[str]:
    """Yield random systems as files of a program that samples, without our comment."""
    semantics = {"fll": "fuzzylite", "fcl": "fcl"}[kind]
    weighed = (weighed_systems.SYSTEMS[name] for name in ("constant", "linear"))
    drawn = (system for system in sampled_systems(160, 1200) if system.semantics == semantics)
    if kind == "fcl":
        drawn = map(_as_jfuzzylogic_knows, drawn)
    for system in (*weighed, *drawn):
        try:
            text = without_comment(FORMS[kind].write(alone(system)).text)
        except NotExpressible:
            continue
        # a bell is one but for rounding far around its centre, where engines count all points as highest
        if len(text) < LONGEST and not ("GBELL" in text and "METHOD : COG" not in text):
            yield text


def _as_jfuzzylogic_knows(system: FuzzySystem) -> FuzzySystem:
    """Return a system whose operators are duals, and whose outputs all aggregate alike."""
    and_operator = system.and_operator if system.and_operator in DUALS else "min"
    ways = list(ACCUMULATIONS.values())
    has_centroids = all(system.defuzzifier_of(output) == "centroid" for output in system.outputs)
    way = (
        ways[len(system.rules) % len(ways)] if has_centroids else "max"
    )  # sums make plateaus but for rounding
    outputs = tuple(replace(output, aggregation=way) for output in system.outputs)
    rules = tuple(replace(rule, and_operator=None, or_operator=None) for rule in system.rules)
    joined = replace(system, and_operator=and_operator, or_operator=DUALS[and_operator])
    implication = "product" if len(rules) % 2 else "min"
    return replace(joined, rules=rules, outputs=outputs, implication=implication)


def _evaluated(kind: str, program: dialects.Program) -> list[dict[str, Any]]:
    cases: list[dict[str, Any]] = []
    path = Path(tempfile.mkdtemp()) / f"stored.{kind}"
    for text in texts(kind):
        if len(cases) == FILES:
            break
        path.write_text(text, encoding="utf-8")
        system = only(text, kind)
        inputs = dialects.samples(system, SAMPLES, is_inside=False).round(3)
        try:
            outputs = program(path, system, inputs)
        except dialects.Missing:
            continue
        if np.isfinite(outputs).mean() > 0.5:
            cases.append({"text": text, "inputs": inputs.tolist(), "outputs": outputs.tolist()})
    return cases


def only(text: str, kind: str) -> FuzzySystem:
    """Return the one system of a file."""
    (system,) = loads(text, kind).systems
    return system


def table() -> str:
    """Return the rows of the page's table, from what is stored."""
    rows = []
    for program, stored in load().items():
        files, values = len(stored["cases"]), sum(np.size(case["outputs"]) for case in stored["cases"])
        rows.append(f"| {program} | {stored['version']} | {files} | {values} | {stored['agrees']} |")
    return "\n".join(rows)


def main() -> None:
    """Store the values anew; those that others published are kept."""
    stored = load()
    programs = {
        "pyfuzzylite": ("fll", dialects.pyfuzzylite),
        "jFuzzyLogic": ("fcl", dialects.jfuzzylogic(sys.argv[1])),
    }
    for name, (kind, program) in programs.items():
        stored[name]["cases"] = _evaluated(kind, program)
    FILE.write_text(json.dumps(stored, indent=1, allow_nan=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
