"""The drawing of fitted missions, from what ``python -m benchmarks missions --store`` has stored."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from docs.scripts.drawing import Drawing

STORED = Path(__file__).resolve().parents[2] / "benchmarks" / "missions.json"
#: px: a mission's row, the left end of the axis, and a percent along it
ROW, LEFT, PERCENT = 26, 330, 3.2


def missions() -> Drawing:
    """Draw how often flights succeed in each mission: as shipped, fitted, and at most, with seconds."""
    rows = list(json.loads(STORED.read_text(encoding="utf-8")).values())
    drawing = Drawing(
        760, 76 + ROW * len(rows), "Missions and their controllers", (LEFT, 48.0), (PERCENT, 1.0)
    )
    bottom = -float(ROW * len(rows))
    for share in (0, 25, 50, 75, 100):
        drawing.line([(share, 8.0), (share, bottom)], "grid")
        drawing.word(f"{share} %", (share, bottom), "small", 0.0, 18.0, "middle")
    drawing.word("success, 95 % intervals; upright: the most possible", (0.0, 22.0), "small")
    drawing.word("s", (112.0, 22.0), "small", 0.0, 0.0, "end")
    for index, row in enumerate(rows):
        at = -ROW * (index + 0.5)
        drawing.word(row["words"], (0.0, at), "", -14.0, 5.0, "end")
        if row["shipped"] is not None:
            interval(drawing, row["shipped"]["success"], at + 4.0, "muted", "dark")
        interval(drawing, row["last"]["success"], at - 4.0, "seen-box", "seen")
        if row["flyable"]["fraction"] < 1.0:
            most = 100.0 * row["flyable"]["fraction"]
            drawing.line([(most, at - 10.0), (most, at + 10.0)])
        drawing.word(f"{row['seconds']:.0f}", (112.0, at), "small", 0.0, 5.0, "end")
    return drawing


def interval(drawing: Drawing, success: Mapping[str, Any], at: float, line: str, dot: str) -> None:
    """Draw a share and its interval."""
    drawing.line([(100.0 * success["low"], at), (100.0 * success["high"], at)], line)
    drawing.dot((100.0 * success["fraction"], at), 3.5, dot)
