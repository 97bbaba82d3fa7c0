"""A run's folder with few cases, every number chosen so that its meaning is plain."""

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


def write_evaluation(folder: Path) -> Path:
    (folder / "evaluate").mkdir(parents=True)
    (folder / "config.yaml").write_text(CONFIG, encoding="utf-8")
    flown = {
        "case": np.repeat(np.array(CASES, dtype=np.int32), NUM_SAMPLES),
        "sample": np.tile(np.arange(NUM_SAMPLES, dtype=np.int32), len(CASES)),
        **{f"position_{axis}_m": positions()[:, :, i].ravel() for i, axis in enumerate("xyz")},
    }
    write_table(folder / "evaluate/trajectories.parquet", flown)
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
