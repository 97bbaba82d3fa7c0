"""Intact samples of files, to damage."""

import contextlib
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.trials import trials
from pipeline.flight.fly.stepping import NUM_SEEN
from pipeline.report.figures.training import HISTORY_COLUMNS
from pipeline.settings.experiment import HparamsSearch

CSV: Final = b"time_s,x,y\n0,0.1,1\n1,0.2,2\n2,0.4,1\n3,0.1,0\n"
RUN: Final = {"folder": "seed=1", "differs": {"seed": "1"}, "command": ["seed=1"], "failure": ""}
SWEEP: Final = {"sweep_version": 1, "runs": [RUN, {**RUN, "folder": "seed=2"}]}


def journal(path: Path) -> object:
    space = {"optimizer": {"initial_step": {"low": 0.001, "high": 1.0}}}
    with contextlib.redirect_stderr(io.StringIO()):
        return list(trials(path, HparamsSearch(space=space, trials=2), 1, lambda _values: iter([1.0])))


def parquet(**columns: Any) -> bytes:
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def numbers_as_parquet(_folder: Path) -> Sequence[bytes]:
    numbers = {"time_s": np.arange(9.0), "x": np.linspace(0, 1, 9), "y": np.linspace(1, 0, 9)}
    return [parquet(**numbers, word=list("abcabcabc"))]


def network(nodes: Sequence[onnx.NodeProto], constants: Mapping[str, Any]) -> bytes:
    """Return an ONNX file whose nodes make ``force`` of ``seen``."""
    seen, force = (onnx.helper.make_tensor_value_info(name, 1, None) for name in ("seen", "force"))
    tensors = [onnx.numpy_helper.from_array(np.float32(array), name) for name, array in constants.items()]
    graph = onnx.helper.make_graph(nodes, "policy", [seen], [force], tensors)
    content: bytes = onnx.helper.make_model(graph).SerializeToString()
    return content


def small_policy(_folder: Path) -> Sequence[bytes]:
    weights = {"w": np.ones((NUM_SEEN, 4)), "b": np.ones(4), "v": np.ones((4, 3))}
    steps = (("Gemm", ["seen", "w", "b"], "a"), ("Tanh", ["a"], "c"), ("MatMul", ["c", "v"], "force"))
    return [network([onnx.helper.make_node(kind, names, [made]) for kind, names, made in steps], weights)]


def small_stl(_folder: Path) -> Sequence[bytes]:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
    faces = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    rows = np.concatenate([np.zeros((4, 3), np.float32), faces.reshape(4, 9)], axis=1)
    return [bytes(80) + (4).to_bytes(4, "little") + b"".join(row.tobytes() + b"\0\0" for row in rows)]


def tried_journal(folder: Path) -> Sequence[bytes]:
    journal(folder / "journal.log")
    return [(folder / "journal.log").read_bytes()]


def saved_checkpoint(folder: Path) -> Sequence[bytes]:
    from pipeline.training.evolution.rounds import evolve_rounds  # noqa: PLC0415 - brings DEAP

    def evaluate_round(_index: int, _champion: object) -> Callable[[Any], dict[str, Any]]:
        return lambda genomes: {"fitness": genomes.sum(axis=1)}

    optimizer = compose_experiment(["+experiment=train_paper"]).experiment.optimizer
    small = replace(optimizer, population_size=6, generations=2)
    evolve_rounds(evaluate_round, 3, small, 1, checkpoint=folder / "made.npz")
    return [(folder / "made.npz").read_bytes()]


def flown(folder: Path) -> Sequence[bytes]:
    """Record a short flight without any force."""
    from tests.pipeline.recording.cases import staged  # noqa: PLC0415 - flies

    staged(folder, "controller=paper_champion", "duration_s=60")
    return [(folder / "episodes" / "start.mcap").read_bytes()]


MEAN: Final = {"mean": 1.0, "standard_deviation": 0.5}
SHARE: Final = {"count": 2, "fraction": 0.5, "low": 0.1, "high": 0.9}
SUMMARY: Final = {
    "controller_sha256": "0",
    "num_cases": 4,
    "delta_v_m_s": MEAN,
    "inspection_rate_percent": MEAN,
    "success": SHARE,
    "violated": SHARE,
}
EVIDENCE: Final = {
    "schema": "evidence",
    "controller": {"name": "paper_champion", "sha256": "0" * 64},
    "requirements": [
        {"id": "R1", "title": "Far", "verdict": "shown", "sentence": "Shown: it stays far."},
        {"id": "R2", "verdict": "not shown", "text": "It is fast.", "why": "few flights"},
    ],
}
LOGBOOK: Final = (",".join(HISTORY_COLUMNS) + "\n" + "0,1.5,2.5,0.4,3,0,0\n" * 3).encode()
FORCES: Final = b"time_s,force_x_n,force_y_n,force_z_n\n0,0.1,0,0\n10,0,0.1,0\n"
