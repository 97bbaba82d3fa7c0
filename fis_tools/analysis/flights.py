"""Fuzzy systems along logged data: recorded flights, and tables of inputs.

This is the one file of the package that reads recordings.
"""

from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fis_tools.analysis import tables
from fis_tools.analysis.arrays import firing
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile as compiled
from fis_tools.errors import ControllerFileError, MissingExtra, raised_as
from fis_tools.formats import serialize
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.model.thrust import UNKNOWN
from fis_tools.words.text import with_unit

if TYPE_CHECKING:
    from telemetry.file.recording import Recording, TopicColumns
from fis_tools.analysis.flight_data import (
    SAME_TIME_S,
    FlightOutcome,
    FlownSystem,
    Period,
    Points,
    PointsAlong,
)

CONTROLLER_ATTACHMENT = "controller.json"
TOPIC_PREFIX = "/fis/"
CONSTANTS_METADATA = "constants"
CONTROL_TOPICS = "*/control"
PULLS_TOPICS, PULLS_METADATA = "*/pulls", "pulls"
#: what only recordings of one vehicle of a fleet say of their episode
EPISODE_METADATA, FLEET_KEY = "episode", "fleet_deputies"
#: where a flight ends
MISSION_TOPIC = "/mission"


class Logged(NamedTuple):
    """All that is read of a flight or a table, at once.

    Attributes
    ----------
    flown : sequence of FlownSystem
    controller : FuzzyController, optional
        Which the flight carries along; a table carries none.
    outcome : FlightOutcome, optional
        Of a flight.
    """

    flown: Sequence[FlownSystem]
    controller: FuzzyController | None
    outcome: FlightOutcome | None


def is_flight(path: Path | str) -> bool:
    """Return, from its name, whether a file is a logged flight."""
    return Path(path).suffix.lower() == ".mcap"


def read_controller(path: Path | str) -> FuzzyController:
    """Read the controller stored in a logged flight.

    Raises
    ------
    ControllerFileError
        If the flight cannot be read, or was not flown by a fuzzy controller.
    """
    return _controller_of(_read(path, topics=()))


def read_flight(
    path: Path | str, all_periods: bool = False, controller: FuzzyController | None = None
) -> tuple[FlownSystem, ...]:
    """Read every inference of each fuzzy system of a controller, in the controller's order.

    Parameters
    ----------
    path : path
        A logged flight, which carries its controller along, or a table.
    all_periods : bool
        Give every inference, not only those whose output was fired; a table holds no others.
    controller : FuzzyController, optional
        For a table: whose inputs it holds.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, a log does not fit the controller it carries, or a table has not a column
        for each input.
    """
    flown_systems, *_ = _all_flown(path, controller)
    return _counted(flown_systems, all_periods)


def read_logged(
    path: Path | str, all_periods: bool = False, controller: FuzzyController | None = None
) -> Logged:
    """Read a flight or a table once: what `read_flight` and `read_outcome` return, and the controller.

    Raises
    ------
    ControllerFileError
        As of these.
    """
    flown_systems, recording, carried = _all_flown(path, controller, (MISSION_TOPIC,))
    outcome = _outcome_of(recording) if recording is not None and is_flight(path) else None
    return Logged(_counted(flown_systems, all_periods), carried, outcome)


def _counted(flown_systems: Iterable[FlownSystem], all_periods: bool) -> tuple[FlownSystem, ...]:
    return tuple(flown if all_periods else flown.at(flown.is_counted) for flown in flown_systems)


def read_outcome(path: Path | str) -> FlightOutcome:
    """Read the outcome of a flight.

    Raises
    ------
    ControllerFileError
        If the flight cannot be read.
    """
    return _outcome_of(_read(path, topics=(MISSION_TOPIC, CONTROL_TOPICS)))


def _outcome_of(recording: "Recording") -> FlightOutcome:
    """Return the outcome of a flight from its recorded ends, distances and forces."""
    end, control = recording.outcome, _topic(recording, "/control")
    goal, is_success = recording.episode.inspection_threshold_percent, None
    if goal is not None and "inspected_count" in end:
        # of the points that can be inspected, which earlier versions did not record
        inspectable = end["inspectable_count"] or end["num_points"]
        is_success = bool(100.0 * end["inspected_count"] >= goal * inspectable - 1e-7)
    nearest, farthest = recording.episode.min_distance_m, recording.episode.max_distance_m
    is_outside = None
    if end and nearest is not None and farthest is not None:
        # the start may lie outside
        distance = recording[MISSION_TOPIC]["distance_m"][1 : recording.last_sample + 1].astype(np.float64)
        is_outside = bool(np.any((distance < nearest) | (distance > farthest)))
        if recording.episode.keep_out_m and not is_outside:
            is_outside = None  # spheres move, and where they are is not read here
    acted = None
    if control is not None and len(control):
        reasons = [control[name].reshape(len(control), -1) for name in ("reason", "command_reason")]
        is_safety = np.hstack(reasons) == "safety"
        acted = int(is_safety.any(axis=1).sum()) if is_safety.size else None
    return FlightOutcome(
        end_s=recording.episode.end_s,
        came_to=end,
        is_success=is_success,
        is_outside=is_outside,
        num_safety=acted,
        constants=dict(recording.metadata.get(CONSTANTS_METADATA, {})),
    )


def read_periods(
    path: Path | str, time_s: float, controller: FuzzyController | None = None
) -> tuple[Period, ...]:
    """Read each fuzzy system's inference in the control period that contains a time.

    A period holds until the next; the last is taken to hold for as long as the one before it did.

    Parameters
    ----------
    path : path
        A logged flight, which carries its controller along, or a table.
    time_s : float
        Of a table without times: the number of a row, from 1.
    controller : FuzzyController, optional
        For a table: whose inputs it holds.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, does not fit the controller, or holds nothing of that time.
    """
    flown_systems, recording, _ = _all_flown(path, controller)
    starts = np.empty(0)
    if recording is not None:
        starts = recording.control_time_s[recording.control_time_s < recording.end_s]
    times = [starts] if len(starts) else [flown.time_s for flown in flown_systems]
    starts = np.unique(np.concatenate([np.empty(0), *times]))
    hold = float(starts[-1] - starts[-2]) if len(starts) > 1 else 0.0
    if not len(starts) or not starts[0] <= time_s <= starts[-1] + hold:
        span = f"covers {starts[0]:g} to {starts[-1] + hold:g} s" if len(starts) else "has none"
        unit = "control period" if recording else "row"
        raise ControllerFileError(
            f"{time_s:g} s is on no {unit} of {path}, which {span}; choose a time among these"
        )
    index = int(np.searchsorted(starts, time_s, side="right")) - 1
    return tuple(_period(flown, float(starts[index]), recording) for flown in flown_systems)


def read_rehearsals(path: Path | str, time_s: float) -> dict[str, list[tuple[float, str]]]:
    """Return the cost of each rehearsed alternative, m/s, cheapest first, by what was chosen.

    Choices that were not yet made by that time, or were over, are left out.

    Raises
    ------
    ControllerFileError
        If the flight cannot be read.
    """
    if not is_flight(path):
        return {}
    recording = _read(path, topics=())
    with _understood():
        rehearsals = recording.rehearsals
    return {
        what if rehearsal.num_tried is None else f"{what}, best of {rehearsal.num_tried:,}": sorted(
            zip(rehearsal.costs_m_s, rehearsal.names, strict=True)
        )
        for what, rehearsal in rehearsals.items()
        if rehearsal.from_s <= time_s < rehearsal.until_s
    }


def read_points(path: Path | str, time_s: float) -> Points | None:
    """Read each point's part in the inputs in a control period; None where it is not recorded.

    Raises
    ------
    ControllerFileError
        If the flight cannot be read.
    """
    points = _points_of(_read(path, topics=(PULLS_TOPICS, CONTROL_TOPICS))) if is_flight(path) else None
    return None if points is None else points.at(time_s)


def _topic(recording: "Recording", ending: str) -> "TopicColumns | None":
    return next((topic for name, topic in recording.topics.items() if name.endswith(ending)), None)


def _points_of(recording: "Recording") -> PointsAlong | None:
    """Return each point's part in the inputs along a flight; None where it is not recorded."""
    cloud, control = _topic(recording, "/pulls"), _topic(recording, "/control")
    if cloud is None or control is None or not len(cloud) or not len(control):
        return None
    names = tuple(recording.metadata.get(PULLS_METADATA, {}))
    numbers = {name for name, values in cloud.columns.items() if values.ndim == 2}
    if missing := {"last_light_s", "is_missed", *names} - numbers or {"position_m"} - cloud.columns.keys():
        lacking = ", ".join(sorted(missing))
        raise ControllerFileError(f"{recording.path}: {cloud.topic} lacks {lacking}; log it again")
    is_asked = np.isfinite(control["coasting_missed"])
    is_shared = FLEET_KEY in recording.metadata.get(EPISODE_METADATA, {})
    return PointsAlong(cloud, control.time_s, is_asked, names, is_shared)


def _period(flown: FlownSystem, start_s: float, recording: "Recording | None") -> Period:
    """Return a system's inference in the control period that starts at a time, if it made one."""
    rows = np.flatnonzero(np.abs(flown.time_s + flown.delay_s - start_s) < SAME_TIME_S)
    row = int(rows[0]) if len(rows) else None
    name, starts = flown.system.outputs[0].name, np.array([start_s])
    reason = UNKNOWN if recording is None else str(recording.fired_reasons(name, starts)[0])
    return Period(flown, start_s, reason, row)


def inputs_along(
    paths: Iterable[Path | str], all_periods: bool = False, controller: FuzzyController | None = None
) -> dict[str, Floats]:
    """Return the inputs that a controller's systems sensed along one flight or several.

    Parameters
    ----------
    paths : iterable of paths
        Flights of the same controller, and tables of its inputs.
    all_periods : bool
        Return what they sensed at every inference, not only at those whose output was fired.
    controller : FuzzyController, optional
        For tables: whose inputs they hold.

    Returns
    -------
    dict
        By the system's name, (n, num_inputs), before values are clipped to the universes.

    Raises
    ------
    ControllerFileError
        If a flight cannot be read, or the flights carry different rules.
    """
    rows: dict[str, list[Floats]] = {}
    systems: dict[str, FuzzySystem] = {}
    for path in paths:
        for flown in read_flight(path, all_periods, controller):
            name = flown.system.name
            if systems.setdefault(name, flown.system) != flown.system:
                raise ControllerFileError(
                    f"{path} was flown with another system {name!r} than the flights before it; look at "
                    "flights of one controller at a time"
                )
            rows.setdefault(name, []).append(flown.inputs)
    return {name: np.concatenate(parts) for name, parts in rows.items()}


def require_same_inputs(path: Path | str, flown: Iterable[FuzzySystem], controller: FuzzyController) -> None:
    """Raise ControllerFileError for a flight without this controller's systems, or with other inputs."""
    by_name = {system.name: system for system in controller.systems}
    pairs = [(system, by_name[system.name]) for system in flown if system.name in by_name]
    if not pairs:
        raise ControllerFileError(
            f"{path} was flown without any of the systems {', '.join(by_name)}; "
            "give flights of this controller"
        )
    for pair in pairs:
        logged, wanted = (", ".join(variable.name for variable in system.inputs) for system in pair)
        if logged != wanted:
            raise ControllerFileError(
                f"{path}: its system {pair[0].name!r} senses {logged}, but the controller's senses {wanted}; "
                "give flights of this controller"
            )


def _tabled(path: Path | str, system: FuzzySystem) -> FlownSystem:
    """Infer a system at the inputs of a table."""
    labels = {variable.name: with_unit(variable) for variable in system.inputs}
    inputs, time_s = tables.read(path, list(labels), labels)
    times = np.arange(1.0, len(inputs) + 1.0) if time_s is None else time_s
    output = compiled(system)(inputs)[:, 0]
    reason = np.full(len(inputs), UNKNOWN)
    strengths = firing(system, inputs)
    return FlownSystem(system, times, inputs, strengths, output, reason, is_timed=time_s is not None)


def _read(path: Path | str, topics: tuple[str, ...]) -> "Recording":
    """Read topics of a recorded flight; raise MissingExtra without the package telemetry."""
    try:
        from telemetry.file import reader  # noqa: PLC0415 - not a package that fuzzy systems need
    except ModuleNotFoundError as error:
        raise MissingExtra(
            "reading recorded flights (.mcap)",
            "the package telemetry" if error.name == "telemetry" else str(error.name),
            ". (in a copy of this project's sources)",
        ) from error
    with _understood():
        return reader.read(path, topics)


def _understood() -> AbstractContextManager[None]:
    """Turn the errors of a faulty recording into a `ControllerFileError`."""
    from telemetry.file import reader  # noqa: PLC0415 - as in `_read`

    return raised_as(ControllerFileError, reader.RecordingError)


def _controller_of(recording: "Recording") -> FuzzyController:
    """Return the controller that a recording carries."""
    content = recording.attachments.get(CONTROLLER_ATTACHMENT)
    if content is None:
        raise ControllerFileError(
            f"{recording.path} carries no {CONTROLLER_ATTACHMENT}; give the controller's file instead"
        )
    where = f"{recording.path}, {CONTROLLER_ATTACHMENT}: "
    with raised_as(ControllerFileError, ControllerFileError, UnicodeDecodeError, where=where):
        return serialize.loads(content.decode("utf-8"), "json")


def _all_flown(
    path: Path | str, controller: FuzzyController | None, more: tuple[str, ...] = ()
) -> tuple[list[FlownSystem], "Recording | None", FuzzyController | None]:
    """Return every inference along a flight, the recording and its controller; of a table every row alone."""
    if tables.is_table(path):
        if controller is None:
            raise ControllerFileError(
                f"{path} is a table, which carries no controller; say whose inputs it holds, as a controller "
                "file"
            )
        return [_tabled(path, system) for system in controller.systems], None, None
    recording = _read(path, topics=(f"{TOPIC_PREFIX}*", CONTROL_TOPICS, PULLS_TOPICS, *more))
    carried = _controller_of(recording)
    return [_flown(recording, carried, system) for system in carried.systems], recording, carried


def _flown(recording: "Recording", controller: FuzzyController, system: FuzzySystem) -> FlownSystem:
    """Return every inference that a system of a recorded flight made."""
    topic = TOPIC_PREFIX + system.name
    if topic not in recording.topics:
        raise ControllerFileError(
            f"{recording.path} has no topic {topic}, but its controller has a system {system.name!r}; log "
            "the flight again"
        )
    messages = recording.topics[topic]
    count = len(messages)
    widths = {"inputs": len(system.inputs), "firing_strengths": len(system.rules)}
    columns = {}
    for field, width in widths.items():
        values = np.asarray(messages[field], dtype=np.float64)
        if count and values.shape != (count, width):
            raise ControllerFileError(
                f"{recording.path}: {topic} holds {values.shape[-1]} {field}, but its controller's system "
                f"has {width}; the log and the controller are not of one flight"
            )
        columns[field] = values.reshape(count, width)
    output = np.asarray(messages["output_n"], dtype=np.float64)
    axes = dict(controller.attributes).get("force_axes", "")
    reason = recording.reasons(system.outputs[0].name, messages.time_s, axes)
    logged = (messages.time_s, columns["inputs"], columns["firing_strengths"], output, reason)
    points = _points_of(recording)
    flown = FlownSystem(system, *logged, delay_s=recording.command_age_s, points=points)
    return flown.at(messages.time_s < recording.end_s)
