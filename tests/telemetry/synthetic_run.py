"""A run's folder with few cases and few generations, every number chosen so that its meaning is plain."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

NUM_SAMPLES = 7
#: of case 0 to 3: at 50 m; at 60 m; falls to 10 m at sample 3; rises to 120 m at sample 5
CASES = (3, 5, 8, 13)
DELTA_V = (1.0, 4.0, 2.0, 3.0)
COUNTS = (99, 95, 96, 70)
CONFIG = """\
control_period_s: 20.0
inspection_threshold_percent: 95.0
deputy: {min_distance_m: 15.0, max_distance_m: 200.0}
chief: {inspection_radius_m: 10.0}
"""


def positions() -> NDArray[np.float32]:
    """(4, NUM_SAMPLES, 3): along i, j, k and -i."""
    distance = np.array([[50.0], [60.0], [40.0], [80.0]]) * np.ones(NUM_SAMPLES)
    distance[2, 3], distance[3, 5] = 10.0, 120.0
    directions = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0]], dtype=np.float64)
    return (distance[:, :, None] * directions[:, None]).astype(np.float32)


def write_table(path: Path, columns: dict[str, object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(columns), path)


def track_columns(tracks: NDArray[np.float32]) -> dict[str, object]:
    return {
        "sample": np.tile(np.arange(tracks.shape[1], dtype=np.int32), len(tracks)),
        **{f"position_{axis}_m": tracks[:, :, i].ravel() for i, axis in enumerate("xyz")},
    }


def write_evaluation(folder: Path) -> Path:
    (folder / "evaluate").mkdir(parents=True)
    (folder / "config.yaml").write_text(CONFIG, encoding="utf-8")
    cases = np.repeat(np.array(CASES, dtype=np.int32), NUM_SAMPLES)
    write_table(folder / "evaluate/trajectories.parquet", {"case": cases, **track_columns(positions())})
    rate = 100.0 * np.array(COUNTS) / 99
    write_table(
        folder / "evaluate/episodes.parquet",
        {
            "case": list(CASES),
            "delta_v_m_s": list(DELTA_V),
            "inspected_count": list(COUNTS),
            "inspection_rate_percent": rate,
            "success": [bool(value >= 95.0) for value in rate],
            "violated": [False, False, True, False],
        },
    )
    return folder


def champion_track(row: int) -> NDArray[np.float32]:
    """Where the champion that came with a row flew: a line of its own length."""
    return (np.linspace(75.0, 60.0 - row, NUM_SAMPLES)[:, None] * [1.0, 0.0, 0.0]).astype(np.float32)


#: of each row: round, generation, fitness, and whether its champion is new
ROWS = ((0, 0, 1e5, True), (0, 1, 1e5, False), (0, 2, 10.0, True), (1, 0, 0.0, True), (1, 1, 0.0, False))


def write_training(folder: Path, num_rows: int = len(ROWS)) -> Path:
    """Write what a training has left behind after some generations, as it does: the flights first."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = ROWS[:num_rows]
    new = [(number, row) for number, row in enumerate(rows) if row[3]]
    tracks = np.stack([champion_track(number) for number, _ in new])
    moments = np.repeat([row[:2] for _, row in new], NUM_SAMPLES, axis=0).astype(np.int32)
    write_table(
        folder / "train/trajectories.parquet",
        {"round": moments[:, 0], "generation": moments[:, 1], **track_columns(tracks)},
    )
    unfinished = folder / "train/.history"
    write_table(
        unfinished,
        {
            "round": [row[0] for row in rows],
            "generation": [row[1] for row in rows],
            "best": [row[2] for row in rows],
            "mean": [10.0 * row[2] for row in rows],
            "step_size": [1.0] * len(rows),
            "delta_v_m_s": [2.5] * len(rows),
            "points": [97.0] * len(rows),
            "outside": [0.0] * len(rows),
            "outside_m": [0.0] * len(rows),
            "short": [3.0] * len(rows),
            "genome": [[0.5, 0.25]] * len(rows),
        },
    )
    unfinished.replace(folder / "train/history.parquet")
    return folder
