"""All readers of files and settings, the errors they may raise, and intact samples to damage."""

import contextlib
import io
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import onnx
import pyarrow as pa
import pyarrow.parquet as pq

import telemetry
from fis_tools.analysis import tables as logged
from fis_tools.analysis.condition import read_conditions, read_region
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.formats.exchange import fcl
from fis_tools.learning import table
from fis_tools.model.validate import InvalidSystem
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.played import read_played
from pipeline.controllers.policies import policy_of
from pipeline.evaluation.assurance import requirements
from pipeline.evaluation.trials import trials
from pipeline.flight.fly.stepping import NUM_SEEN
from pipeline.flight.world import surface
from pipeline.recording.reflight import fly_again
from pipeline.run import artifacts, sweep, tables
from pipeline.settings import start_table
from pipeline.settings.experiment import HparamsSearch, Mission
from pipeline.settings.places import conf_folder, requirements_path
from pipeline.settings.schema import experiment_from
from pipeline.training.evolution.state import CheckpointError, load
from telemetry.file.recover import recover
from telemetry.file.summary import in_words, summarize
from telemetry.scene import runs

CSV: Final = b"time_s,x,y\n0,0.1,1\n1,0.2,2\n2,0.4,1\n3,0.1,0\n"
SWEEP: Final = {
    "sweep_version": 1,
    "runs": [
        {"folder": f"seed={seed}", "differs": {"seed": str(seed)}, "command": [f"seed={seed}"], "failure": ""}
        for seed in (1, 2)
    ],
}

#: the errors that may be raised, with our own messages
REFUSALS: Final = (
    serialize.ControllerFileError, InvalidSystem, artifacts.ArtifactError, telemetry.RecordingError,
    CheckpointError,
)  # fmt: skip


@dataclass(frozen=True)
class Reader:
    """A reader with its samples.

    Parameters
    ----------
    name : str
    read : callable
        Takes the bytes of a file and a folder to put them in.
    samples : sequence of bytes
        Intact files.
    kind : str
        ``text``, ``tree`` (JSON of plain data), ``table`` (Parquet), ``recording``, ``attachments`` (of one)
        or ``bytes``.
    refusals : tuple of types
    """

    name: str
    read: Callable[[bytes, Path], object]
    samples: Sequence[bytes]
    kind: str = "text"
    refusals: tuple[type[Exception], ...] = REFUSALS


def _controller(kind: serialize.Kind) -> Callable[[bytes, Path], object]:
    def read(content: bytes, folder: Path) -> object:
        path = folder / f"controller.{kind}"
        path.write_bytes(content)
        controller = serialize.load(path)
        return serialize.dump_json(controller), serialize.dump_yaml(controller)

    return read


def _settings(content: bytes, _folder: Path) -> object:
    try:
        notes = json.loads(content)
    except RecursionError as error:  # from this harness: settings come from Hydra
        raise ValueError("too deep") from error
    return replace(experiment_from(notes))


def _run_folder(content: bytes, folder: Path) -> object:
    (folder / artifacts.CONFIG).write_bytes(content)
    (folder / artifacts.MANIFEST).write_bytes(content)
    for read in (artifacts.read_config, artifacts.read_manifest):
        try:
            read(folder)
        except artifacts.ArtifactError:
            continue
    return runs.file_of(folder, "evaluation_episodes")


@cache
def _minute() -> Mission:
    return compose_experiment(["+experiment=fly", "duration_s=60"]).experiment.mission


def _forces(content: bytes, folder: Path) -> object:
    path = folder / "forces.csv"
    path.write_bytes(content)
    return read_played(path, _minute())


def _recording(content: bytes, folder: Path) -> object:
    path = folder / "flight.mcap"
    path.write_bytes(content)
    (folder / "rescued.mcap").unlink(missing_ok=True)
    with contextlib.suppress(telemetry.RecordingError):
        recover(path, folder / "rescued.mcap")
    recording = telemetry.read(path)
    return in_words(summarize(recording)), [
        telemetry.flat_table(recording, name) for name in recording.topics
    ]


def _table(content: bytes, folder: Path) -> object:
    path = folder / "trajectories.parquet"
    path.write_bytes(content)
    with contextlib.suppress(artifacts.ArtifactError):
        tables.read_parquet(folder, path.name)
    return runs.read_evaluation(path).distance_m


def _checkpoint(content: bytes, folder: Path) -> object:
    path = folder / "checkpoint.npz"
    path.write_bytes(content)
    return load(path, {})


def _conditions(content: bytes, _folder: Path) -> object:
    text = content.decode("utf-8", "replace")
    system = _champion().systems[0]
    return read_region(system, text), read_conditions(text, [variable.name for variable in system.inputs])


def _starts(content: bytes, _folder: Path) -> object:
    tables = start_table.split(content.decode("utf-8-sig"), "starts.path")
    for one in tables:
        start_table.check_within(one, "starts.path", (15.0, 800.0))
    return [start_table.numbers(one, "starts.path") for one in tables]


def _requirements(content: bytes, _folder: Path) -> object:
    return requirements.read(content.decode("utf-8", "replace"), "requirements.yaml")


def _policy(content: bytes, _folder: Path) -> object:
    return policy_of("policy", content, "policy.onnx")


def _mesh(suffix: str) -> Callable[[bytes, Path], object]:
    def read(content: bytes, folder: Path) -> object:
        path = folder / f"chief.{suffix}"
        path.write_bytes(content)
        return surface.spread_points(surface.read_mesh(str(path)), 20)

    return read


def _sweep(content: bytes, folder: Path) -> object:
    (folder / sweep.SWEEP).write_bytes(content)
    return [sweep.state_of(folder, run) for run in sweep.read(folder)]


def _journal(content: bytes, folder: Path) -> object:
    path = folder / "journal.log"
    path.write_bytes(content)
    space = {"optimizer": {"initial_step": {"low": 0.001, "high": 1.0}}}
    with contextlib.redirect_stderr(io.StringIO()):
        return list(trials(path, HparamsSearch(space=space, trials=2), 1, lambda _values: iter([1.0])))


def _learned(suffix: str) -> Callable[[bytes, Path], object]:
    def read(content: bytes, folder: Path) -> object:
        path = folder / f"table.{suffix}"
        path.write_bytes(content)
        return table.as_table(table.read(path), "y", ["time_s", "x"])

    return read


def _logged(suffix: str) -> Callable[[bytes, Path], object]:
    def read(content: bytes, folder: Path) -> object:
        path = folder / f"table.{suffix}"
        path.write_bytes(content)
        return logged.read(path, ["x", "y"])

    return read


def _analyses(content: bytes, folder: Path) -> object:
    """Read a controller and do with it what the commands do."""
    path = folder / "controller.json"
    path.write_bytes(content)
    controller = serialize.load(path)
    system = controller.systems[0]
    middle = [(variable.minimum + variable.maximum) / 2 for variable in system.inputs]
    with contextlib.suppress(ValueError):  # in a sentence: a formula without a value there, for instance
        explain(system, np.array(middle)).text()
    with contextlib.suppress(ValueError):
        source.write(controller)
    return str(audit(controller)), difference(controller, _champion()).text()


def _verified(content: bytes, folder: Path) -> object:
    path = folder / "flight.mcap"
    path.write_bytes(content)
    return fly_again(path)


@cache
def _champion() -> Any:
    return serialize.load(conf_folder() / "controller" / "paper_champion.yaml")


def _parquet() -> bytes:
    columns = {"case": np.repeat([0, 1, 2], 4), "sample": np.tile(np.arange(4), 3),
               **{f"position_{axis}_m": np.linspace(0, 1, 12) for axis in "xyz"}}  # fmt: skip
    sink = io.BytesIO()
    pq.write_table(pa.table(columns), sink)
    return sink.getvalue()


def _numbers_as_parquet() -> bytes:
    sink = io.BytesIO()
    columns = {"time_s": np.arange(9.0), "x": np.linspace(0, 1, 9), "y": np.linspace(1, 0, 9)}
    pq.write_table(pa.table({**columns, "word": list("abcabcabc")}), sink)
    return sink.getvalue()


def _small_policy() -> bytes:
    seen, force = (onnx.helper.make_tensor_value_info(name, 1, None) for name in ("seen", "force"))
    weights = {
        "w": np.ones((NUM_SEEN, 4), np.float32),
        "b": np.ones(4, np.float32),
        "v": np.ones((4, 3), np.float32),
    }
    steps = (("Gemm", ["seen", "w", "b"], "a"), ("Tanh", ["a"], "c"), ("MatMul", ["c", "v"], "force"))
    nodes = [onnx.helper.make_node(kind, inputs, [output]) for kind, inputs, output in steps]
    tensors = [onnx.numpy_helper.from_array(array, name) for name, array in weights.items()]
    graph = onnx.helper.make_graph(nodes, "policy", [seen], [force], tensors)
    content: bytes = onnx.helper.make_model(graph).SerializeToString()
    return content


def _small_stl() -> bytes:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float32)
    faces = corners[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]]
    rows = np.concatenate([np.zeros((4, 3), np.float32), faces.reshape(4, 9)], axis=1)
    return bytes(80) + (4).to_bytes(4, "little") + b"".join(row.tobytes() + b"\0\0" for row in rows)


def _tried_journal(folder: Path) -> bytes:
    _journal(b"", folder)
    return (folder / "journal.log").read_bytes()


def _saved_checkpoint(folder: Path) -> bytes:
    from pipeline.training.evolution.rounds import evolve_rounds  # noqa: PLC0415 - brings DEAP

    optimizer = compose_experiment(["+experiment=train"]).experiment.optimizer
    small = replace(optimizer, population_size=6, generations=2)
    path = folder / "made.npz"
    evolve_rounds(
        lambda _index, _champion: lambda genomes: {"fitness": genomes.sum(axis=1)},
        3,
        small,
        1,
        checkpoint=path,
    )
    return path.read_bytes()


def _flown(folder: Path) -> bytes:
    """Record a short flight without any force."""
    from pipeline.run.runner import run_stages  # noqa: PLC0415 - flies

    run = compose_experiment(["+experiment=fly", "controller=paper_champion", "duration_s=60"])
    run_stages(run.experiment, run.config, folder / "flown")
    return (folder / "flown" / "episodes" / "start.mcap").read_bytes()


def all_readers(names: Sequence[str] = ()) -> Mapping[str, Reader]:
    """Return the readers with some names, all by default, with their samples."""
    champion = _champion()
    one = replace(champion, systems=champion.systems[:1])
    examples = Path(__file__).parents[2] / "docs" / "examples"
    config = compose_experiment(["+experiment=train"]).config
    value_errors = (*REFUSALS, ValueError)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        makers: Mapping[str, Callable[[], Reader]] = {
            "json": lambda: Reader("json", _controller("json"), [serialize.dump_json(one).encode()], "tree"),
            "yaml": lambda: Reader("yaml", _controller("yaml"), [serialize.dump_yaml(one).encode()]),
            "fis": lambda: Reader("fis", _controller("fis"), [(examples / "tipper.fis").read_bytes()]),
            "fll": lambda: Reader("fll", _controller("fll"), [(examples / "dimmer.fll").read_bytes()]),
            "fml": lambda: Reader("fml", _controller("fml"), [(examples / "pendulum.fml").read_bytes()]),
            "fcl": lambda: Reader("fcl", _controller("fcl"), [fcl.write(one).text.encode()]),
            "starts": lambda: Reader(
                "starts", _starts, [(examples / "starts.csv").read_bytes()], "text", value_errors
            ),
            "requirements": lambda: Reader(
                "requirements", _requirements, [requirements_path("inspection").read_bytes()], "text",
                value_errors,
            ),
            "settings": lambda: Reader(
                "settings", _settings, [json.dumps(config).encode()], "tree", value_errors
            ),
            "run": lambda: Reader(
                "run", _run_folder, [json.dumps(config).encode(), b'{"manifest_version": 2}']
            ),
            "forces": lambda: Reader(
                "forces", _forces,
                [b"time_s,force_x_n,force_y_n,force_z_n\n0,0.1,0,0\n10,0,0.1,0\n"], "text", value_errors,
            ),
            "conditions": lambda: Reader(
                "conditions", _conditions,
                [b"distance > 3 and velocity_body_x <= 0.5", b"distance in [1, 2]"],
                "text", value_errors,
            ),
            "table": lambda: Reader("table", _table, [_parquet()], "table"),
            "checkpoint": lambda: Reader("checkpoint", _checkpoint, [_saved_checkpoint(folder)], "bytes"),
            "recording": lambda: Reader("recording", _recording, [_flown(folder)], "recording"),
            "verify": lambda: Reader("verify", _verified, [_flown(folder)], "attachments", value_errors),
            "onnx": lambda: Reader("onnx", _policy, [_small_policy()], "bytes", value_errors),
            "obj": lambda: Reader(
                "obj", _mesh("obj"), [(conf_folder() / "chief" / "satellite.obj").read_bytes()], "text",
                value_errors,
            ),
            "stl": lambda: Reader("stl", _mesh("stl"), [_small_stl()], "bytes", value_errors),
            "sweep": lambda: Reader("sweep", _sweep, [json.dumps(SWEEP).encode()], "tree"),
            "journal": lambda: Reader("journal", _journal, [_tried_journal(folder)], "text", value_errors),
            "learned_csv": lambda: Reader("learned_csv", _learned("csv"), [CSV], "text", value_errors),
            "learned_parquet": lambda: Reader(
                "learned_parquet", _learned("parquet"), [_numbers_as_parquet()], "table", value_errors
            ),
            "logged_csv": lambda: Reader("logged_csv", _logged("csv"), [CSV], "text", value_errors),
            "logged_parquet": lambda: Reader(
                "logged_parquet", _logged("parquet"), [_numbers_as_parquet()], "table", value_errors
            ),
            "analyses": lambda: Reader(
                "analyses", _analyses, [serialize.dump_json(one).encode()], "tree", value_errors
            ),
        }  # fmt: skip
        return {name: makers[name]() for name in (names or makers)}
