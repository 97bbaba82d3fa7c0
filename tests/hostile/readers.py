"""All readers of files and settings, the errors they may raise, and intact samples to damage."""

import contextlib
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa

import telemetry
from fis_tools.analysis import tables as logged
from fis_tools.analysis.condition import read_conditions, read_region
from fis_tools.analysis.domain import as_mapping, box_of
from fis_tools.commands.analysis import _read as read_domain
from fis_tools.findings.audit import audit
from fis_tools.findings.difference import difference
from fis_tools.findings.explanation import explain
from fis_tools.formats import serialize
from fis_tools.formats.c import source
from fis_tools.learning import table
from fis_tools.model.validate import InvalidSystem
from fis_tools.processors import num_processors
from fis_tools.review import content as review_content
from fis_tools.review import proved
from fis_tools.review.flown import evaluations
from fis_tools.source import named, read_controller
from pipeline.command_line.arguments import parse_arguments
from pipeline.command_line.config import compose_experiment
from pipeline.command_line.guide import help_on
from pipeline.controllers.played import read_played
from pipeline.controllers.policies import read_policy
from pipeline.evaluation.assurance import repeats
from pipeline.evaluation.assurance.requirements import Requirement, load_requirements
from pipeline.flight.world import surface
from pipeline.optimum.solved import read_solved
from pipeline.proof.certificate import read_proof
from pipeline.recording.reflight import fly_again
from pipeline.report.contents import begins_with_training, command_of, read_numbers
from pipeline.report.figures.training import HISTORY_COLUMNS
from pipeline.report.proof_of_run import read_theorem
from pipeline.run import artifacts, configuration, manifests, sweep, tables
from pipeline.settings import mesh, start_table
from pipeline.settings.experiment import Mission
from pipeline.settings.places import conf_folder, requirements_path
from pipeline.settings.schema import experiment_from
from pipeline.training.evolution.state import CheckpointError, load
from telemetry.file.recover import recover
from telemetry.file.summary import in_words, summarize
from telemetry.scene import runs
from tests.fis_tools.sample_controllers import EXAMPLES
from tests.hostile.forge import CONTROLLER, restated
from tests.hostile.samples import (
    CSV,
    EVIDENCE,
    FORCES,
    LOGBOOK,
    SUMMARY,
    SWEEP,
    flown,
    journal,
    numbers_as_parquet,
    parquet,
    saved_checkpoint,
    small_policy,
    small_stl,
    tried_journal,
)

#: the errors that may be raised, with our own messages
REFUSALS: Final = (
    serialize.ControllerFileError, InvalidSystem, artifacts.ArtifactError, telemetry.RecordingError,
    CheckpointError,
)  # fmt: skip
#: takes the bytes of a file and a folder to put them in
Read = Callable[[bytes, Path], object]
OR_VALUES: Final = (*REFUSALS, ValueError)


@dataclass(frozen=True)
class Reader:
    """A reader with its samples.

    Parameters
    ----------
    read : callable
    make : callable
        Makes intact files in a folder.
    kind : str
        ``text``, ``tree`` (JSON of plain data), ``table`` (Parquet), ``recording``, ``attachments`` (of one)
        or ``bytes``.
    refusals : tuple of types
        What it may raise.
    """

    read: Read
    make: Callable[[Path], Sequence[bytes]]
    kind: str
    refusals: tuple[type[Exception], ...] = OR_VALUES

    @cached_property
    def samples(self) -> Sequence[bytes]:
        """Intact files."""
        with tempfile.TemporaryDirectory() as folder:
            return self.make(Path(folder))


def _in_file(name: str, read: Callable[[Path], object]) -> Read:
    """Return a reader of files of a name."""

    def read_content(content: bytes, folder: Path) -> object:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return read(path)

    return read_content


def _controller(path: Path) -> object:
    controller = serialize.load(path)
    return serialize.dump_json(controller), serialize.dump_yaml(controller)


def _settings(content: bytes, _folder: Path) -> object:
    try:
        notes = json.loads(content)
    except RecursionError as error:  # from this harness: settings come from Hydra
        raise ValueError("too deep") from error
    return replace(experiment_from(notes))


def _run_folder(content: bytes, folder: Path) -> object:
    (folder / artifacts.CONFIG).write_bytes(content)
    (folder / artifacts.MANIFEST).write_bytes(content)
    for read in (configuration.read, manifests.read):
        with contextlib.suppress(artifacts.ArtifactError):
            read(folder)
    return runs.file_of(folder, "evaluation_episodes")


@cache
def _minute() -> Mission:
    return compose_experiment(["+experiment=fly", "duration_s=60"]).experiment.mission


def _recording(path: Path) -> object:
    path.with_name("rescued.mcap").unlink(missing_ok=True)
    with contextlib.suppress(telemetry.RecordingError):
        recover(path, path.with_name("rescued.mcap"))
    recording = telemetry.read(path)
    in_words(summarize(recording))
    return [telemetry.flat_table(recording, name) for name in recording.topics]


def _table(path: Path) -> object:
    with contextlib.suppress(artifacts.ArtifactError):
        tables.read_parquet(path.parent, path.name)
    return runs.read_evaluation(path).distance_m


def _conditions(content: bytes, _folder: Path) -> object:
    text = _text(content)
    system = _champion().systems[0]
    return read_region(system, text), read_conditions(text, [variable.name for variable in system.inputs])


def _starts(path: Path) -> object:
    settings = {"starts": {"kind": "file", "path": str(path)}, "monte_carlo": {}}
    start_table.read_starts(settings)
    tables = [settings[group]["table"] for group in settings]
    for table_text in tables:
        list(start_table.distances(table_text, "starts.path"))
    return [start_table.numbers(table_text, "starts.path") for table_text in tables]


def _named_here(path: Path) -> object:
    with contextlib.chdir(path.parent), contextlib.suppress(serialize.ControllerFileError):
        return named("nobody")
    return None


def _trained(path: Path) -> object:
    for name in ("train/champion.json", "champion.json"):
        (path.parent / name).parent.mkdir(exist_ok=True)
        (path.parent / name).write_bytes(_single_as_json())
    return read_controller(path.parent)


def _logbook(path):
    return read_numbers(path.parents[1], artifacts.LOGBOOK, HISTORY_COLUMNS)


def _surroundings(path: Path) -> object:
    return runs._surroundings(path.parent)


def _own_configs(path: Path) -> object:
    folder = path.parents[1]
    return help_on((), parse_arguments(["--config-dir", str(folder), "+experiment=fly"]).folders)


def _solved(path: Path) -> object:
    folder = path.parents[1]
    columns = {"case": np.array([0]), "is_feasible": np.array([True]), "delta_v_m_s": np.array([0.1])}
    tables.write_parquet(folder / artifacts.OPTIMUM_CASES, columns)
    (folder / artifacts.OPTIMUM_SUMMARY).write_text("{}")
    return read_solved(folder).plan(0, _minute())


def _parts(path: Path) -> object:
    tables.notes_of(path)
    with contextlib.suppress(pa.ArrowException, OSError, ValueError):
        tables.join_parquet(path.with_name("joined.parquet"), [path])
        return [
            np.max(column) if column.dtype.kind in "biuf" else column
            for column in tables.Columns(path.parent, path.name).values()
        ]
    return tables.read_parquet(path.parent, path.name)


#: evidence of a run beside another
EARLIER = {
    "controller": {"name": "one", "sha256": "0"}, "conditions": {"seed": 2, "num_cases": 9},
    "requirements": [
        {"id": "R1", "verdict": "shown", "formula": "x > 1", "methods": {"cases": {"verdict": "shown"}}}
    ],
}  # fmt: skip


def _evidence(path: Path) -> object:
    (path.parents[1] / "manifest.json").write_text('{"sha256": {"assure/evidence.json": "0"}}')
    says = review_content._as_the_manifest_says(path)
    return says, review_content.read_evidence(path, "0" * 64)


def _earlier(path: Path) -> object:
    (folder := path.parents[2] / "this").mkdir(exist_ok=True)
    tries = repeats.earlier_tries(folder, EARLIER | {"conditions": {"seed": 1, "num_cases": 9}})
    claim = Requirement("R1", "", "", "", "", "", "", ("cases",), "x > 1", None, 0.9, 0.9)
    repeats.seed_ledger(path.parents[1])
    repeats.append(path.parents[1], EARLIER | {"conditions": {"seed": 1, "num_cases": 9}})
    return repeats.tried(claim, (1, 9), tries)


def _run_files(path: Path) -> object:
    begins = begins_with_training(path.parent)
    return begins, artifacts.text_of(path.parent, path.name), artifacts.file_hash(path)


@cache
def _proof() -> Mapping[str, bytes]:
    from tests.pipeline.proof.forged import certificate  # noqa: PLC0415 - proves

    with tempfile.TemporaryDirectory() as folder:
        return certificate("start on a cell's edge", Path(folder))


def _domain(_folder: Path) -> Sequence[bytes]:
    systems = _champion().systems
    ends = [[(v.minimum, v.maximum) for v in system.inputs] for system in systems]
    boxes = [box_of(system, np.array(each).T) for system, each in zip(systems, ends, strict=True)]
    return [json.dumps(as_mapping(boxes)).encode()]


def _of_proof(name: str) -> Callable[[Path], Sequence[bytes]]:
    return lambda _: [_proof()[name]]


def _in_proof(name: str) -> Read:
    """Return a reader of a certificate of which one file is given, whose hash is restated."""

    def read_content(content: bytes, folder: Path) -> object:
        files = restated({**_proof(), name: content}) if name == CONTROLLER else {**_proof(), name: content}
        for path, part in files.items():
            (folder / path).write_bytes(part)
        return read_proof(folder)

    return read_content


def _processors(path: Path) -> int:
    root = path.parents[2]
    (root / "sys/fs/cgroup/a/b").mkdir(parents=True, exist_ok=True)
    (root / "sys/fs/cgroup/a/b/cpu.max").write_bytes(path.read_bytes())
    return num_processors(root)


def _mesh(path: Path) -> object:
    return surface.spread_points(mesh.read_mesh(str(path)), 20)


def _sweep(content: bytes, folder: Path) -> object:
    (folder / sweep.SWEEP).write_bytes(content)
    return [sweep.state_of(folder, run) for run in sweep.read(folder)]


def _learned(path: Path) -> object:
    return table.as_table(table.read(path), "y", ["time_s", "x"])


def _logged(path: Path) -> object:
    return logged.read(path, ["x", "y"])


def _analyses(path: Path) -> object:
    """Read a controller and do with it what the commands do."""
    controller = serialize.load(path)
    system = controller.systems[0]
    middle = [(variable.minimum + variable.maximum) / 2 for variable in system.inputs]
    with contextlib.suppress(ValueError):  # in a sentence: a formula without a value there, for instance
        explain(system, np.array(middle)).text()
    with contextlib.suppress(ValueError):
        source.write(controller)
    return str(audit(controller)), difference(controller, _champion()).text()


@cache
def _champion() -> Any:
    return serialize.load(conf_folder() / "controller" / "paper_champion.yaml")


def _positions(_folder: Path) -> Sequence[bytes]:
    columns = {f"position_{axis}_m": np.linspace(0, 1, 12) for axis in "xyz"}
    return [parquet(case=np.repeat([0, 1, 2], 4), sample=np.tile(np.arange(4), 3), **columns)]


def _single() -> Any:
    return replace(_champion(), systems=_champion().systems[:1])


def _single_as_yaml() -> bytes:
    return serialize.dump_yaml(_single()).encode()


def _single_as_json() -> bytes:
    return serialize.dump_json(_single()).encode()


def _as_fcl() -> bytes:
    return serialize.writer("fcl")(serialize.load(EXAMPLES / "tipper.fis")).text.encode()


def _config() -> bytes:
    return json.dumps(compose_experiment(["+experiment=train"]).config).encode()


def _text(content: bytes) -> str:
    return content.decode("utf-8", "replace")


def _whole(path: Path) -> Callable[[Path], Sequence[bytes]]:
    return lambda _: [path.read_bytes()]


READERS: Final[Mapping[str, Reader]] = {
    "json": Reader(_in_file("controller.json", _controller), lambda _: [_single_as_json()], "tree", REFUSALS),
    "yaml": Reader(_in_file("controller.yaml", _controller), lambda _: [_single_as_yaml()],
                   "text", REFUSALS),
    "fis": Reader(_in_file("controller.fis", _controller), _whole(EXAMPLES / "tipper.fis"), "text", REFUSALS),
    "fll": Reader(_in_file("controller.fll", _controller), _whole(EXAMPLES / "dimmer.fll"), "text", REFUSALS),
    "fcl": Reader(_in_file("controller.fcl", _controller), lambda _: [_as_fcl()], "text", REFUSALS),
    "starts": Reader(_in_file("starts.csv", _starts), _whole(EXAMPLES / "starts.csv"), "text"),
    "requirements": Reader(_in_file("requirements.yaml",
                                    lambda path: load_requirements(str(path), Mission())),
                           _whole(requirements_path("inspection")), "text"),
    "settings": Reader(_settings, lambda _: [_config()], "tree"),
    "run": Reader(_run_folder, lambda _: [_config(), b'{"manifest_version": 2}'], "text", REFUSALS),
    "forces": Reader(_in_file("forces.csv", lambda path: read_played(path, _minute())), lambda _: [FORCES],
                     "text"),
    "conditions": Reader(_conditions, lambda _: [b"distance > 3 and velocity_body_x <= 0.5",
                                                 b"distance in [1, 2]"], "text"),
    "table": Reader(_in_file("trajectories.parquet", _table), _positions, "table", REFUSALS),
    "checkpoint": Reader(_in_file("checkpoint.npz", lambda path: load(path, {})),
                         saved_checkpoint, "bytes", REFUSALS),
    "recording": Reader(_in_file("flight.mcap", _recording), flown, "recording", REFUSALS),
    "verify": Reader(_in_file("flight.mcap", fly_again), flown, "attachments"),
    "onnx": Reader(_in_file("policy.onnx", read_policy), small_policy, "bytes"),
    "obj": Reader(_in_file("chief.obj", _mesh), _whole(conf_folder() / "chief" / "satellite.obj"), "text"),
    "stl": Reader(_in_file("chief.stl", _mesh), small_stl, "bytes"),
    "sweep": Reader(_sweep, lambda _: [json.dumps(SWEEP).encode()], "tree", REFUSALS),
    "journal": Reader(_in_file("journal.log", journal), tried_journal, "text"),
    "learned_csv": Reader(_in_file("table.csv", _learned), lambda _: [CSV], "text"),
    "learned_parquet": Reader(_in_file("table.parquet", _learned), numbers_as_parquet, "table"),
    "logged_csv": Reader(_in_file("table.csv", _logged), lambda _: [CSV], "text"),
    "logged_parquet": Reader(_in_file("table.parquet", _logged), numbers_as_parquet, "table"),
    "domain": Reader(_in_file("domain.json", read_domain), _domain, "tree", REFUSALS),
    "evidence": Reader(_in_file("assure/evidence.json", _evidence),
                       lambda _: [json.dumps(EVIDENCE).encode()], "tree", REFUSALS),
    "proof_beside_evidence": Reader(
        _in_file(proved.THEOREM, lambda path: proved.proof_in_words(path.parents[1], "0" * 64)),
        lambda _: [b'{"goal": [0.5], "num_periods": 200}'], "tree", REFUSALS),
    "summary": Reader(_in_file("evaluate/summary.json", lambda path: evaluations([path.parents[1]], "")),
                      lambda _: [json.dumps(SUMMARY).encode()], "tree", REFUSALS),
    "manifest": Reader(_in_file("manifest.json", _trained),
                       lambda _: [b'{"files": {"champion": "train/champion.json"}}'], "tree", REFUSALS),
    "project": Reader(_in_file("pyproject.toml", _named_here),
                      lambda _: [b'[tool.fis_tools]\ncontrollers = ["mine"]\n'], "text", REFUSALS),
    "configs": Reader(_in_file("experiment/fly.yaml", _own_configs),
                      _whole(conf_folder() / "experiment" / "fly.yaml"), "text"),
    "surroundings": Reader(_in_file("config.yaml", _surroundings), lambda _: [_config()], "text", REFUSALS),
    "logbook": Reader(_in_file(artifacts.LOGBOOK, _logbook),
                      lambda _: [LOGBOOK], "text", REFUSALS),
    "hydra": Reader(_in_file(".hydra/overrides.yaml", lambda path: command_of(path.parents[1], {})),
                    lambda _: [b"- +experiment=train\n- seed=4\n"], "text", REFUSALS),
    "forces_of_plans": Reader(_in_file(artifacts.OPTIMUM_FORCES, _solved),
                              lambda _: [b"case,time_s,x,y,z\n0,0.0,0.1,0,0\n1,10.0,0,0.1,0\n"], "text",
                              REFUSALS),
    "parts": Reader(_in_file("part.parquet", _parts), _positions, "table", REFUSALS),
    "run_files": Reader(_in_file(artifacts.SCENARIOS, _run_files), _whole(EXAMPLES / "starts.csv"), "text",
                        REFUSALS),
    "theorem": Reader(_in_proof("theorem.json"), _of_proof("theorem.json"), "tree"),
    "proved_controller": Reader(_in_proof("controller.json"), _of_proof("controller.json"), "tree"),
    "tube": Reader(_in_proof("tube.parquet"), _of_proof("tube.parquet"), "table", (*OR_VALUES, OSError)),
    "quoted_theorem": Reader(_in_file(artifacts.THEOREM, lambda path: read_theorem(path.parents[1])),
                             lambda _: [b'{"goal": [0.5], "num_periods": 200}'], "tree",
                             (ValueError, RecursionError)),
    "earlier_ledgers": Reader(
        _in_file(f"other/{artifacts.LEDGER}", _earlier),
        lambda _: [json.dumps(repeats.entry_of(EARLIER)).encode()],
        "tree",
    ),
    "earlier_tries": Reader(_in_file(f"other/{artifacts.EVIDENCE}", _earlier),
                           lambda _: [json.dumps(EARLIER).encode()], "tree", REFUSALS),
    "processors": Reader(_in_file("proc/self/cgroup", _processors),
                         lambda _: [b"0::/a/b\n7:cpu,cpuacct:/a\n"], "text", ()),
    "analyses": Reader(_in_file("controller.json", _analyses), lambda _: [_single_as_json()], "tree",
                       REFUSALS),
}  # fmt: skip


def all_readers(names: Sequence[str]) -> Mapping[str, Reader]:
    """Return the readers with some names; all where none is given."""
    return {name: READERS[name] for name in names or READERS}
