"""Judge a controller on held-out starts: ``python -m pipeline.gym.judge WHAT``.

The tasks, their starts and what is told are fixed by a version, so that results can be compared wherever they
were made. No training draws these starts: those of environments have another place in the spawn key of the
random numbers (`pipeline.scenarios`).
"""

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named, sha256_of
from pipeline.evaluation.beside_optimum import beside_optimum, summarise_times
from pipeline.evaluation.comparison import percent_ahead
from pipeline.evaluation.monte_carlo import SUCCESS, episode_columns, fly_cases, fly_followed, summarise
from pipeline.evaluation.statistics import fraction, statistic, succeeds
from pipeline.flight.control.controller import Controller, ControllerError, PilotController
from pipeline.flight.control.law import played
from pipeline.flight.fly.stepped_fleet import SteppedFleet
from pipeline.flight.fly.stepping import SteppedFlights
from pipeline.flight.state.arrays import Plans
from pipeline.flight.state.log import Scenario
from pipeline.gym.episodes import Reward, Task
from pipeline.gym.suite import COLLISION_M, FLEETS, NUM_DEPUTIES, TASKS, VERSION, seed_of
from pipeline.optimum.solved import IncomparableError, solved_for
from pipeline.run import maker
from pipeline.run.artifacts import ArtifactError
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission
from plain_files.document import Document, Table, text
from plain_files.file_access import write_text

NUM_CASES: Final = 1000
CONFIDENCE_PERCENT: Final = 95.0
#: fleets that are stepped side by side by a function
BESIDE: Final = 64
#: what is told of the flights: the name in the file, that in the columns of an evaluation, words, decimals
MEANS: Final = (
    ("delta_v_m_s", "delta-v (m/s)", 3),
    ("inspection_rate_percent", "inspected (%)", 2),
    ("nearest_pair_m", "nearest two deputies (m)", 1),
)
#: of fleets, the shares in which two deputies come near enough to collide, and of success without
COLLIDED, APART = "collided", "success_apart"
SHARES: Final = (
    (SUCCESS, "success (%)"),
    (APART, "success, no collision (%)"),
    (COLLIDED, f"within {COLLISION_M:g} m of another (%)"),
    ("violated", "outside the limits (%)"),
    ("stays_orbit", "stays an orbit (%)"),
    ("passively_safe", "passively safe (%)"),
)
#: told where some of it was chosen ahead: of the fuel, what rules fired
BY_RULES: Final = ("fuel_by_rules_percent", "fuel that rules fire (%)", 1)

#: from observations, (n, 19), as environments show them, to actions, (n, 3), shares of the greatest force
Acting = Callable[[NDArray[np.float32]], NDArray[Any]]


@dataclass(frozen=True)
class ActingPilot:
    """A function of observations as a pilot, see `pipeline.flight.control.controller.Pilot`."""

    act: Acting
    task: Task
    source: bytes = b""
    turns: bool = False
    draws: bool = False

    def __call__(self, mission: Mission, scenarios: list[Scenario], workers: int | None) -> Plans:
        """Return the plans of flights from some starts, stepped side by side."""
        return played(self._fired(mission, [scenarios], SteppedFlights)[0])

    def together(self, mission: Mission, fleets: Sequence[Sequence[Scenario]], workers: int | None) -> Floats:
        """Return the forces of the deputies of fleets, (m, D, K, 3), of which each asks for its own."""
        parts = [
            self._fired(mission, fleets[first : first + BESIDE], SteppedFleet)
            for first in range(0, len(fleets), BESIDE)
        ]
        return np.concatenate(parts)

    def _fired(
        self, mission: Mission, groups: Sequence[Sequence[Scenario]], stepped: type[SteppedFlights]
    ) -> Floats:
        """Step groups of as many flights side by side; return their forces, (m, n, K, 3), N, Hill axes."""
        flown = [_started(stepped, mission, group) for group in groups]
        forces = np.zeros((len(groups), len(groups[0]), mission.num_controls, 3))
        for k in range(mission.num_controls):
            seen = np.concatenate([flights.seen for flights in flown])
            forces[:, :, k] = self.task.forces(self.act(seen), len(seen)).reshape(len(groups), -1, 3)
            for flights, commanded in zip(flown, forces[:, :, k], strict=True):
                flights.step(commanded)
        return forces


def _started(
    stepped: type[SteppedFlights], mission: Mission, scenarios: Sequence[Scenario]
) -> SteppedFlights:
    """Return flights at their first sample."""
    is_tilted = any(scenario.sun_elevation_rad != 0.0 for scenario in scenarios)
    flights = stepped(mission, len(scenarios), is_tilted=is_tilted)
    for flight, scenario in enumerate(scenarios):
        flights.start(flight, scenario)
    flights.step(np.zeros((len(scenarios), 3)))
    return flights


def judge(
    what: Controller | Acting | str,
    task: str = "paper",
    num_cases: int = NUM_CASES,
    workers: int | None = None,
) -> dict[str, Any]:
    """Fly a task's held-out starts, and tell how.

    Parameters
    ----------
    what : Controller, callable or str
        A controller, its name or the path of its file; or a function from observations, (n, 19) float32, to
        actions, (n, 3), as `pipeline.gym.vector.InspectionVectorEnv` takes them. Of a fleet it flies each
        deputy.
    task : str
        Of `TASKS`.
    num_cases : int
        The first so many starts.
    workers : int, optional
        Threads; one per processor unless given.

    Returns
    -------
    dict
        Plain data: ``suite``, ``task``, what was flown by whom, ``figures`` with 95 % intervals over starts,
        and ``regret``, beside the best plans known for other starts of the same task, where there are some.
        ``fuel_by_rules_percent`` where some of the fuel was chosen ahead: what rules fired of it.

    Raises
    ------
    ValueError
        If there is no such task, or the controller cannot fly it.
    """
    if task not in TASKS:
        raise ValueError(f"there is no task {task!r}; there are {', '.join(TASKS)}")
    words = [*TASKS[task], f"seed={seed_of(task)}", f"monte_carlo.num_cases={num_cases}"]
    composed = compose_experiment(["+experiment=evaluate", "controller=coast", *words])
    experiment, mission = composed.experiment, composed.experiment.mission
    if isinstance(what, str):
        controller: Controller = named(what, mission)
    elif callable(what):
        flown = Task(experiment, composed.config, Reward(), None)
        controller = PilotController(getattr(what, "__name__", "policy"), ActingPilot(what, flown))
    else:
        controller = what
    scenarios = evaluation_scenarios(experiment)
    try:
        outcomes, after = fly_followed(mission, controller, scenarios, workers)
    except ControllerError as error:
        if task not in FLEETS:
            raise
        raise ControllerError(
            f"task {task!r} is of {NUM_DEPUTIES} deputies; {error}, or take a task of one, such as paper"
        ) from error
    columns = episode_columns(mission, scenarios, outcomes, after)
    summary = summarise(columns, CONFIDENCE_PERCENT) | (_apart(columns) if task in FLEETS else {})
    shown = [name for name, *_ in (*MEANS, *SHARES) if name in summary]
    ahead = percent_ahead(summary)
    return {
        "suite": VERSION,
        "task": task,
        "overrides": list(TASKS[task]),
        "seed": experiment.seed,
        "num_cases": num_cases,
        "confidence_percent": CONFIDENCE_PERCENT,
        "controller": {"name": controller.name, "sha256": sha256_of(controller)},
        "figures": {name: summary[name] for name in shown},
        **({BY_RULES[0]: 100.0 - ahead} if ahead else {}),
        "regret": _regret(replace(experiment, seed=1), controller, workers),
        "product": maker.product_version(),
    }


def _apart(columns: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the shares of fleets in which two deputies come too near to each other, and of success without.

    An environment's episode ends with a collision; here fleets fly on, so that all of them are told.
    """
    has_collided = columns["nearest_pair_m"] < COLLISION_M
    shares = {COLLIDED: has_collided, APART: succeeds(columns) & ~has_collided}
    return {name: asdict(fraction(is_so, CONFIDENCE_PERCENT)) for name, is_so in shares.items()}


def _regret(experiment: Any, controller: Controller, workers: int | None) -> dict[str, Any]:
    """Return what a controller burns beyond the best plans known, and relative to what every plan burns."""
    try:
        solved = solved_for(experiment)
    except (IncomparableError, ArtifactError) as reason:
        return {"not_compared": str(reason)}
    flown, _ = fly_cases(experiment.mission, controller, solved.scenarios, workers)
    columns = beside_optimum(flown, solved.cases, solved.harder)
    beyond = columns["delta_v_m_s"] - columns["optimum_as_seen_delta_v_m_s"]
    spread = statistic(np.asarray(beyond), CONFIDENCE_PERCENT, -np.inf, np.inf)
    times = summarise_times(columns, CONFIDENCE_PERCENT)
    kept = ("num_cases", "num_successful", "times_optimum_as_seen", "times_bound")
    return {
        "regret_m_s": {"mean": spread.mean, "low": spread.low, "high": spread.high},
        **{name: times[name] for name in kept},
    }


def table(judged: Sequence[Mapping[str, Any]]) -> str:
    """Return results as a plain table, a column each."""
    rows = [["task", *(str(result["task"]) for result in judged)]]
    measured = {name for result in judged for name in result["figures"]}
    for name, words, decimals in (each for each in MEANS if each[0] in measured):
        rows.append([words, *(_mean(result["figures"].get(name), decimals) for result in judged)])
    for name, words in (each for each in SHARES if each[0] in measured):
        rows.append([words, *(_share(result["figures"].get(name)) for result in judged)])
    rows.append(
        ["beyond the best plan (m/s)", *(_mean(result["regret"].get("regret_m_s"), 3) for result in judged)]
    )
    if any(BY_RULES[0] in result for result in judged):
        rows.append([BY_RULES[1], *(fired_by_rules(result) for result in judged)])
    heads = ["", *(str(result["controller"]["name"]) for result in judged)]
    return text.write(Document([Table(heads, rows, numbers=range(1, len(heads)))]))


def fired_by_rules(result: Mapping[str, Any]) -> str:
    """Return what rules fired of the fuel, in per cent; nothing where no push was chosen ahead."""
    name, _, decimals = BY_RULES
    return f"{result[name]:.{decimals}f}" if name in result else ""


def _mean(measure: Mapping[str, Any] | None, decimals: int) -> str:
    if measure is None:
        return "-"
    mean = f"{measure['mean']:.{decimals}f}"
    if measure["low"] is None:
        return mean
    return f"{mean} ({measure['low']:.{decimals}f} to {measure['high']:.{decimals}f})"


def _share(measure: Mapping[str, Any] | None) -> str:
    if measure is None:
        return "-"
    share, low, high = (100.0 * measure[part] for part in ("fraction", "low", "high"))
    return f"{share:.1f} ({low:.1f} to {high:.1f})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge controllers, print the table, and write the results if a file is named."""
    parser = argparse.ArgumentParser(
        prog="python -m pipeline.gym.judge",
        description=f"Fly the held-out starts of {VERSION}; tell fuel, success and regret with intervals.",
    )
    parser.add_argument(
        "what", nargs="+", help="controllers by name or path: champion_27, my.yaml, policy.onnx"
    )
    parser.add_argument("--task", choices=TASKS, action="append", help="paper unless given; may be repeated")
    parser.add_argument("--cases", type=int, default=NUM_CASES, help="the first so many starts")
    parser.add_argument("-o", "--output", type=Path, help="a JSON file of the results, for others to compare")
    options = parser.parse_args(arguments)
    output: Path | None = options.output
    if output and (output.is_dir() or not output.parent.is_dir()):
        parser.error(f"{output} cannot be written; -o takes a file in a folder that there is")
    judged = []
    try:
        for task in options.task or ["paper"]:
            for what in options.what:
                sys.stderr.write(f"  {task}: {what}\n")
                judged.append(judge(what, task, options.cases))
    except ValueError as error:
        parser.error(str(error))
    sys.stdout.write(table(judged))
    if output:
        try:
            write_text(output, json.dumps(judged, indent=1) + "\n")
        except OSError as error:
            parser.error(
                f"{output} cannot be written: {error.strerror}; make room, or choose another with -o"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
