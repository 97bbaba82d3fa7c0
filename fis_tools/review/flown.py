"""The flights and tables that a controller is reviewed along.

Both are called flights in the code; the page calls them logs where no flight is among them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.analysis import arrays, flights, tables
from fis_tools.analysis.flight_data import FlightOutcome, FlownSystem
from fis_tools.array_types import Floats
from fis_tools.errors import ControllerFileError, raised_as
from fis_tools.model import FuzzyController, FuzzySystem
from plain_files.document import Table
from plain_files.file_access import read_text
from plain_files.plain_text import parse_json


@dataclass(frozen=True)
class Flight:
    """A flight, or a table of inputs.

    Parameters
    ----------
    name : str
    flown : mapping of str to FlownSystem
        What each system did on it, by the system's name.
    is_own : bool
        Whether the reviewed controller flew it: with systems and attributes as they are now.
    outcome : FlightOutcome, optional
        Of a flight.
    num_made : int, optional
        Where inferences are left out since their force was not fired, how many the system made that made the
        most.
    """

    name: str
    flown: Mapping[str, FlownSystem]
    is_own: bool
    outcome: FlightOutcome | None = None
    num_made: int | None = None

    @property
    def num_inferences(self) -> int:
        """The number of inferences of the system that made the most."""
        return max(len(inferences.time_s) for inferences in self.flown.values())


@dataclass(frozen=True)
class SensedInputs:
    """Inputs of a system, (n, num_inputs), and their source in words."""

    inputs: Floats
    words: str
    are_flown: bool


def read_flights(
    paths: Sequence[Path], controller: FuzzyController, all_periods: bool = False
) -> list[Flight]:
    """Read the flights and tables to review a controller along.

    One is called as its file, or as its path.

    Of each the inferences whose force was fired are read, or all.

    Raises
    ------
    fis_tools.errors.ControllerFileError
        If one cannot be read, or its systems have other inputs than the controller's.
    """
    systems = {system.name: system for system in controller.systems}
    flights_read = []
    for name, path in zip(_names(paths), paths, strict=True):
        read, flew, outcome = flights.read_logged(path, True, controller)
        flights.require_same_inputs(path, (inferences.system for inferences in read), controller)
        made = {
            inferences.system.name: inferences for inferences in read if inferences.system.name in systems
        }
        is_own = flew is None or controller.acts_like(flew)
        if all_periods or all(inferences.is_counted.all() for inferences in made.values()):
            flights_read.append(Flight(name, made, is_own, outcome))
            continue
        fired = {system: inferences.at(inferences.is_counted) for system, inferences in made.items()}
        num_made = max(len(inferences.time_s) for inferences in made.values())
        flights_read.append(Flight(name, fired, is_own, outcome, num_made))
    return flights_read


def _names(paths: Sequence[Path]) -> list[str]:
    """Return the shortest unique ends of paths, without suffix."""
    parts = [path.with_suffix("").parts for path in paths]
    lengths = range(1, max((len(pieces) for pieces in parts), default=0) + 1)
    candidates = (["/".join(pieces[-length:]) for pieces in parts] for length in lengths)
    return next((names for names in candidates if len(set(names)) == len(set(parts))), [])


def samples_of(system: FuzzySystem, flown: Sequence[Flight], noun: str) -> SensedInputs:
    """Return a system's inputs on the flights, or samples of its ranges if it sensed nothing."""
    rows = [flight.flown[system.name].inputs for flight in flown if system.name in flight.flown]
    sensed = np.concatenate([np.empty((0, len(system.inputs))), *rows])
    if len(sensed):
        words = f"along the {noun}" if len(flown) == 1 else f"along the {len(flown)} {noun}s"
        return SensedInputs(sensed, words, are_flown=True)
    spread = arrays.spread_inputs(system)
    return SensedInputs(
        spread, f"over {len(spread):,} points spread evenly over all its inputs", are_flown=False
    )


SUMMARY = Path("evaluate") / "summary.json"
RECORDINGS = "episodes"
EPISODES = Path("evaluate") / "episodes.parquet"
#: so many of the flights that fail are named
MOST_NAMED = 3
UNKNOWN = "–"


def recordings(paths: Sequence[Path | str]) -> list[Path]:
    """Return the recordings named, and those of the runs' folders named, each once.

    Raises
    ------
    ControllerFileError
        If a folder holds no recording.
    """
    recorded: list[Path] = []
    for path in map(Path, paths):
        inside = sorted((path / RECORDINGS).glob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise ControllerFileError(
                f"{path} is a folder without {RECORDINGS}/*.mcap; give the folder of a run that has recorded "
                "flights, a flight, or a table (.csv, .parquet)"
            )
        recorded += inside
    return list({path.resolve(): path for path in recorded}.values())


@dataclass(frozen=True)
class Evaluation:
    """A run's evaluation: its summary, its worst failures, and whose flights they are.

    They are the reviewed controller's own if the summary names its SHA-256.
    """

    summary: Mapping[str, Any]
    worst: str
    is_own: bool


def evaluations(paths: Sequence[Path | str], sha256: str) -> list[Evaluation]:
    """Return the evaluations of the runs named, or of the runs whose recordings are named.

    `sha256` is the fingerprint of the reviewed controller.
    """
    folders = [path if path.is_dir() else path.parent.parent for path in map(Path, paths)]
    results = []
    for folder in dict.fromkeys(folders):
        if (folder / SUMMARY).is_file():
            with raised_as(
                ControllerFileError, OSError, ValueError, RecursionError, where=f"{folder / SUMMARY}: "
            ):
                summary = parse_json(read_text(folder / SUMMARY))
            if not isinstance(summary, dict):
                raise ControllerFileError(f"{folder / SUMMARY}: it is no summary of an evaluation")
            is_own = summary.get("controller_sha256") == sha256
            results.append(Evaluation(summary, _worst(folder / EPISODES), is_own))
            try:
                failures(results[-1])
                _evaluation_row(results[-1])
            except (LookupError, TypeError, ValueError, ArithmeticError, AttributeError) as error:
                raise ControllerFileError(
                    f"{folder / SUMMARY}: it is no summary of an evaluation; repeat the stage evaluate"
                ) from error
    return results


def _worst(path: Path) -> str:
    """Return the flights of an evaluation that failed by the most."""
    if not path.is_file():
        return ""
    wanted = ("case", "success", "violated", "inspection_rate_percent")
    rows = tables.read_parquet(path, lambda names: [name for name in (*wanted, END) if name in names])
    if set(wanted) - set(rows):
        return ""
    failed = ~rows["success"].astype(bool) | rows["violated"].astype(bool)
    order = sorted(np.flatnonzero(failed), key=lambda row: rows["inspection_rate_percent"][row])[:MOST_NAMED]
    if END in rows:
        return ", ".join(f"case {rows['case'][row]} (ends after {rows[END][row]:g} s)" for row in order)
    return ", ".join(
        f"case {rows['case'][row]} ({rows['inspection_rate_percent'][row]:.1f} %"
        f"{', outside' if rows['violated'][row] else ''})"
        for row in order
    )


def failures(evaluation: Evaluation) -> str:
    """Describe how often an evaluation's flights fail, and which failed worst."""
    summary, count = evaluation.summary, evaluation.summary["num_cases"]
    missing, leaving = ("inspect too little", "leave the limits")
    if END in summary:
        missing, leaving = ("do not reach the goal", "fail on the way")
    parts = []
    if rate := summary.get("success"):
        failed, low, high = count - rate["count"], 1 - rate["high"], 1 - rate["low"]
        missed = {"count": failed, "fraction": failed / count, "low": low, "high": high}
        parts.append(f"{_share(missed, count)} {missing}")
    if rate := summary.get("violated"):
        parts.append(f"{_share(rate, count)} {leaving}")
    worst = f" The worst: {evaluation.worst}." if evaluation.worst else ""
    whose = "" if evaluation.is_own else " of another controller, which tells nothing of this one"
    return f"Over all {count:,} flights of the evaluation{whose}: {'; '.join(parts)}.{worst}"


def flown_table(
    evaluations: Sequence[Evaluation], names: Sequence[str], flown: Sequence[FlightOutcome]
) -> list[Table]:
    """Tabulate the outcomes of flights, with the columns of inspecting or of reaching a goal.

    Those of an evaluation stand together, then each that was recorded. Recorded flights are chosen, and stand
    for no others: nothing is counted over them.
    """
    has_goal = any(END in outcome.summary for outcome in evaluations) or any(
        outcome.end_s is not None for outcome in flown
    )
    achieved, failed = ("goal reached (%)", "failed on the way") if has_goal else ("inspected (%)", "outside")
    heads = ("flights", "delta-v (m/s)", achieved, "success", "distance (m)", failed, "safety acted")
    rows = [_evaluation_row(evaluation) for evaluation in evaluations]
    rows += [_flight_row(name, outcome) for name, outcome in zip(names, flown, strict=True)]
    levels = dict.fromkeys(
        f"{evaluation.summary.get('confidence_percent', 95.0):g} %" for evaluation in evaluations
    )
    intervals = f"; {' and '.join(levels)} confidence intervals of shares in brackets" if levels else ""
    caption = f"Means ± standard deviations{intervals}. Recorded flights are chosen to be looked at."
    return [Table(heads, rows, caption=caption)] if rows else []


#: of a summary: enough inspected, and never outside
SUCCESS = "success_and_within_limits"
#: of a summary of flights towards a goal: when they end
END = "end_s"


def _evaluation_row(evaluation: Evaluation) -> list[str]:
    """Return the row of an evaluation, whose columns are those of flights."""
    summary, count = evaluation.summary, evaluation.summary["num_cases"]
    spent, rate = (summary[name] for name in ("delta_v_m_s", "inspection_rate_percent"))
    return [
        f"all {count} of the evaluation{'' if evaluation.is_own else ' of another controller'}",
        _spread(spent, 3),
        _spread(rate, 2),
        _share(summary.get(SUCCESS), count),
        UNKNOWN,
        *(_share(summary.get(name), count) for name in ("violated", "safety_acted")),
    ]


def _spread(statistic: Mapping[str, float | None], decimals: int) -> str:
    """Return a mean with its standard deviation, which one flight does not have."""
    mean, deviation = statistic["mean"], statistic["standard_deviation"]
    return f"{mean:.{decimals}f}" if deviation is None else f"{mean:.{decimals}f} ± {deviation:.{decimals}f}"


def _share(statistic: Mapping[str, float] | None, count: int) -> str:
    """Return a count with its share and interval, in words."""
    if statistic is None:
        return UNKNOWN
    low, high = 100 * statistic["low"], 100 * statistic["high"]
    return (
        f"{statistic['count']:.0f} of {count}: {100 * statistic['fraction']:.1f} % ({low:.1f} to {high:.1f})"
    )


def _flight_row(name: str, outcome: FlightOutcome) -> list[str]:
    """Return the row of a flight; unknown where its file does not say."""

    def number(key: str, digits: int) -> str:
        return f"{outcome.came_to[key]:.{digits}f}" if key in outcome.came_to else UNKNOWN

    def word(value: bool | None) -> str:
        return UNKNOWN if value is None else "yes" if value else "no"

    nearest, farthest = number("min_distance_m", 1), number("max_distance_m", 1)
    return [
        name,
        number("delta_v_m_s", 3),
        number("inspection_rate_percent", 2),
        word(
            None
            if None in (outcome.is_success, outcome.is_outside)
            else outcome.is_success and not outcome.is_outside
        ),
        f"{nearest} to {farthest}" if outcome.came_to else UNKNOWN,
        word(outcome.is_outside),
        UNKNOWN if outcome.num_safety is None else f"in {outcome.num_safety} periods",
    ]
