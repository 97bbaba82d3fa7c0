"""Runs the stages of an experiment in a folder, one after the other, and keeps the manifest up to date."""

import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from pipeline.run import artifacts, configuration, interrupts, maker, manifests, typed, writing
from pipeline.settings import plugged
from pipeline.settings.experiment import Experiment, Mission
from pipeline.settings.stages import STAGES, in_order
from plain_files.streams import guarded

_LOG = logging.getLogger("pipeline")


class Unimproved(str):
    """A sentence that a training handed back what it was given; the run then has an exit code of its own."""

    __slots__ = ()


class Missed(str):
    """A sentence that a fit misses its goal; the run then has an exit code of its own, too."""

    __slots__ = ()


class Interrupted(KeyboardInterrupt):
    """Interrupt from the keyboard during a run; says what was kept and how to continue."""


def run_stages(
    experiment: Experiment,
    config: Mapping[str, Any],
    folder: Path,
    stages: Sequence[str] | None = None,
    command: Sequence[str] | None = None,
) -> list[str]:
    """Run stages; return a sentence for each proof not found, training without gain, and goal missed.

    Parameters
    ----------
    experiment : Experiment
    config : mapping
        The same as plain data, for the folder.
    folder : Path
        Made if missing.
    stages : sequence of str, optional
        Those to run; by default all of the experiment's.
    command : sequence of str, optional
        The arguments with which a new run is started; by default those in its manifest.

    Raises
    ------
    pipeline.run.maker.NotInForce
        If the experiment is to be reproducible, and this process is not.
    Interrupted
        After an interrupt from the keyboard; the manifest then says what is finished.
    """
    if experiment.reproducible:
        maker.require_reproducible()
    with guarded():
        return _run_stages(experiment, config, folder, stages, command)


def _run_stages(
    experiment: Experiment,
    config: Mapping[str, Any],
    folder: Path,
    stages: Sequence[str] | None,
    command: Sequence[str] | None,
) -> list[str]:
    """Run stages one after the other, with a log and the manifest kept up to date; see `run_stages`."""
    stages = experiment.stages if stages is None else tuple(stages)
    folder.mkdir(parents=True, exist_ok=True)
    manifest = manifest_of(experiment, config, manifests.read_if_any(folder), command)
    present = manifest["makers"].index(maker.present_maker())
    _begin(manifest, stages[0], present, is_resumed=experiment.resume)
    configuration.write(folder, config)
    manifests.write(folder, manifest)
    missing: list[str] = []
    with _logged_to(folder / artifacts.LOG):
        for index, name in enumerate(stages, start=1):
            sys.stderr.write(f"[{index}/{len(stages)}] {name}\n")
            started = time.perf_counter()
            try:
                with _makers_named(manifest, name), interrupts.heeded():
                    unproved = stage_function(name)(experiment, folder)
            except KeyboardInterrupt as error:
                manifests.write(folder, manifest)
                _LOG.info("stage %s interrupted%s", name, interrupts.in_words())
                raise Interrupted(_kept(folder, name, manifest["finished_stages"])) from error
            except Exception:  # raised again below: here the run's own log records it too
                _check_there(folder)
                _LOG.exception("stage %s failed", name)
                raise
            _check_there(folder)
            _LOG.info("stage %s took %.2f s", name, time.perf_counter() - started)
            missing += [unproved] if unproved else []
            # later stages were made from files that are no longer there
            finished = manifest["finished_stages"]
            order = in_order(experiment.stages, *finished, name)
            before = [stage for stage in finished if order.index(stage) < order.index(name)]
            manifest["finished_stages"] = [*before, name]
            if index < len(stages):
                _begin(manifest, stages[index], present, is_resumed=False)
            manifests.write(folder, manifest)
    return missing


def stage_function(name: str) -> Callable[[Experiment, Path], str | None]:
    """Return the function that runs a stage: a module's of ours, or one that an installed package offers.

    Raises
    ------
    pipeline.settings.plugged.PluginError
        If the package cannot be used.
    """
    if name in STAGES:
        function: Any = import_module(f"pipeline.stages.{name}").run
        return function
    return plugged.function(plugged.STAGES, name)


def _check_there(folder: Path) -> None:
    """Raise WriteError if the run's folder has been deleted or moved."""
    if not (folder / artifacts.CONFIG).exists():
        raise writing.WriteError(
            f"{folder} has been deleted or moved while the run was at work; start the run again, or go on "
            "where it is now, resume=FOLDER"
        )


def manifest_of(
    experiment: Experiment,
    config: Mapping[str, Any],
    earlier: Mapping[str, Any],
    command: Sequence[str] | None = None,
) -> dict[str, Any]:
    """Return the manifest of a run that begins or goes on, without the hashes of its files.

    Parameters
    ----------
    experiment : Experiment
    config : mapping
        The same as plain data.
    earlier : mapping
        The manifest so far, empty where there is none.
    command : sequence of str, optional
        The arguments with which the run is started, after ``python -m pipeline``; by default those before.

    Returns
    -------
    dict
        Among others ``makers``, all that have worked on the run, on any machine; ``made_by``, for each
        stage that was begun the indices of its makers; ``scene``, parameters for plotting its flights;
        ``controller_edited``, how the configured controller differs from what its provenance tells of.
    """
    makers, present = _makers(earlier), maker.present_maker()
    if_any = {
        "controller_edited": _edited(config.get("controller", {})),
        "git_revision": present["git_revision"],
        "tags": experiment.tags or None,
    }
    return {
        "manifest_version": manifests.MANIFEST_VERSION,
        "name": config["name"],
        "config_hash": configuration.config_hash(config),
        "seed": config["seed"],
        "command": earlier.get("command", ()) if command is None else command,
        "finished_stages": earlier.get("finished_stages", []),
        "files": manifests.ROLES,
        "scene": scene_of(experiment.mission),
        "versions": present["versions"],
        "makers": makers,
        "made_by": dict(earlier.get("made_by", {})),
        **{name: value for name, value in if_any.items() if value is not None},
    }


def _makers(earlier: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the makers of a run with the present one; report its differences from the last before."""
    before: list[dict[str, Any]] = earlier.get("makers", [])
    if not before and "versions" in earlier:  # a run of a version that kept only the last one
        before = [{"versions": earlier["versions"], "git_revision": earlier.get("git_revision")}]
    now = maker.present_maker()
    if now in before:
        return before
    if before and (differing := maker.unlike(before[-1], now)):
        sys.stderr.write(
            f"note: another maker began this run ({'; '.join(differing)}); what is made now may differ from "
            "what it would have made, and the manifest names both\n"
        )
    return [*before, now]


def _begin(manifest: dict[str, Any], stage: str, present: int, *, is_resumed: bool) -> None:
    """Record the present maker of a stage, by its index; a resumed stage may have several."""
    earlier = manifest["made_by"].get(stage, []) if is_resumed else []
    manifest["made_by"][stage] = [*(index for index in earlier if index != present), present]


@contextmanager
def _makers_named(manifest: dict[str, Any], stage: str) -> Iterator[None]:
    """Record the makers of the tasks that others carry out for a stage, even if it fails."""
    with maker.collected() as others:
        try:
            yield
        finally:
            makers, made_by = manifest["makers"], manifest["made_by"][stage]
            makers += [other for other in others if other not in makers]
            made_by += sorted({makers.index(other) for other in others} - set(made_by))


def _edited(source: Mapping[str, Any]) -> str | None:
    """Return how the controller was edited since its provenance was written; None if it was not."""
    from fis_tools.errors import ControllerFileError  # noqa: PLC0415 - only runs need them
    from fis_tools.formats import serialize  # noqa: PLC0415 - as above

    with suppress(ControllerFileError):
        if "systems" in source:
            return serialize.edited(serialize.from_mapping(source))
        if "path" in source and "kind" not in source:
            return serialize.edited(serialize.load(source["path"]))
    return None


def scene_of(mission: Mission) -> dict[str, float]:
    """Return the parameters for plotting a mission's flights, such as limits and the threshold of success."""
    threshold = {"threshold_percent": mission.inspection_threshold_percent}
    return {
        "sample_period_s": mission.control_period_s,
        "min_distance_m": mission.deputy.min_distance_m,
        "max_distance_m": mission.deputy.max_distance_m,
        "chief_radius_m": mission.chief.inspection_radius_m,
        **(threshold if mission.problem.kind == "inspection" else {}),
    }


def _kept(folder: Path, stage: str, finished: Sequence[str]) -> str:
    """Return a sentence on what an interrupted run has kept and how to continue."""
    files = [name for name in artifacts.list_artifacts(folder) if name != artifacts.CONFIG]
    if (folder / artifacts.CHECKPOINT).exists():
        files.append(artifacts.CHECKPOINT)
    done = f"finished before: {', '.join(finished)}" if finished else "no stage was finished before"
    kept = f"kept in {folder}: {', '.join(files)}" if files else f"nothing to keep in {folder} yet"
    begin = f"interrupted{interrupts.in_words()} in the stage {stage}"
    return f"{begin} ({done}); {kept}. To go on: {typed.resume(folder)}"


class _Log(logging.FileHandler):
    """A log without which the run goes on where it cannot be written."""

    has_failed = False

    def __init__(self, path: Path) -> None:
        super().__init__(path, encoding="utf-8", delay=True)
        try:
            self.stream = self._open()
        except OSError as error:
            self._fail(error)

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line, unless writing failed before."""
        if not self.has_failed:
            super().emit(record)

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - logging's name
        """Report an error."""
        if isinstance(error := sys.exc_info()[1], OSError):
            self._fail(error)
        else:
            super().handleError(record)

    def _fail(self, error: OSError) -> None:
        """Report once that the log cannot be written."""
        self.has_failed = True
        sys.stderr.write(
            f"note: {self.baseFilename} cannot be written ({error.strerror or error}); "
            "the run has no log from here on\n"
        )

    def close(self) -> None:
        """Close the file, even if some of it could not be written."""
        with suppress(OSError):
            super().close()


@contextmanager
def _logged_to(path: Path) -> Iterator[None]:
    """Append the packages' log messages to a file."""
    handler = _Log(path)
    formatter = logging.Formatter("%(asctime)s UTC %(levelname)s %(name)s: %(message)s")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    loggers = [logging.getLogger(name) for name in ("pipeline", "fis_tools", "telemetry")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.removeHandler(handler)
            logger.setLevel(level)
        handler.close()
