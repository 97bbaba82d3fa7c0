"""Which champion to take, by world and Sun: results that stand, with their commands, on other pages."""

import csv
from pathlib import Path
from typing import Final

from fis_tools.file_access import read_shipped

#: what is no rule where one signs rules
LOW_ORBIT: Final = (
    "In champion_leo the 15 rules say how much of a push to make. Where to is no rule: the tour is 20\n"
    "constants (tour_*_m), and which of its images it follows, flights ahead choose (rehearsal_tours)."
)


def table() -> list[list[str]]:
    """Return headings and a row for each champion: what was measured, and the page under docs that has it."""
    return list(csv.reader(read_shipped(Path(__file__).with_suffix(".csv")).splitlines()))


def recommendations() -> str:
    """Return the recommendations as text, and which parts of the low-orbit controllers are no rules."""
    lines = ["which champion to take"]
    for name, rules, world, sun, delta_v, success, outside, layer, purpose, _ in table()[1:]:
        measured = [f"{delta_v} m/s, success {success}, {outside} outside"] if delta_v else []
        measured += [f"with safety=filter or robust {layer}"] if layer else []
        lines.append(f"  controller={name} world={world} ({rules} rules, Sun {sun}): {purpose}")
        lines.append(f"      {'; '.join(measured)}")
    return "\n".join([*lines, LOW_ORBIT])
