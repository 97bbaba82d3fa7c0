"""Deputies that aim at one another: what the product corrects, moved by SciPy's matrix exponential."""

from collections.abc import Iterator

import numpy as np

from fis_tools.engines.kernel import LANES
from pipeline.command_line.config import compose_experiment
from pipeline.flight.fly.fleets import NO_LOSSES, apart_of, make_exchange
from pipeline.flight.fly.workspace import make_state
from pipeline.flight.period.act.apart import assure_apart
from pipeline.flight.reference.motion import pushed
from pipeline.flight.reference.safety import SafetyLayer
from pipeline.flight.state.arrays import Moment
from pipeline.flight.world.pack import pack_world

#: how what deputies tell one another is heard
LINKS = {
    "at once": ((), 0.0),
    "late": (("fleet.delay_periods=2",), 0.0),
    "with losses": ((), 0.4),
    "late with losses": (("fleet.delay_periods=1",), 0.7),
    "never": ((), 1.0),
}
APART_M = 10.0
#: control periods of an attack
PERIODS = 40
WORDS = ("+experiment=evaluate_fleet", "controller=champion_27", "sun=random", "safety=filter")


def mission_of(deputies: int, *words: str):
    fleet = (f"fleet.deputies={deputies}", f"fleet.keep_apart_m={APART_M:g}")
    return compose_experiment([*WORDS, *fleet, *words]).experiment.mission


class Fleet:
    """Deputies whose commands are corrected by the product, and moved by SciPy's matrix exponential."""

    def __init__(self, mission, states: np.ndarray, lost=NO_LOSSES) -> None:
        self.mission, self.states, self.k = mission, states, 0
        self._world, self._apart = pack_world(mission.of_each), apart_of(mission)
        self._link = make_exchange(self._world, mission.fleet, LANES, lost).link
        self._state = make_state(self._world, None)
        self.layer = SafetyLayer(mission.of_each)
        # P, from a state to the place of its stop
        self.stops = self.layer.checks[1]

    def corrected(self, forces: np.ndarray) -> np.ndarray:
        count, lanes = len(self.states), self._state
        for lane in range(lanes.truth.position.shape[1]):
            row = min(lane, count - 1)
            lanes.truth.position[:, lane], lanes.truth.velocity[:, lane] = np.split(self.states[row], 2)
            lanes.lanes.commanded[:, lane] = forces[row]
        assure_apart(Moment(self._world, self._state, 0, count, self.k), self._apart, self._link)
        return np.array(lanes.lanes.commanded[:, :count].T)

    def move(self, forces: np.ndarray) -> None:
        period = self.mission.control_period_s
        moved = zip(self.states, forces, strict=True)
        self.states = np.array([pushed(self.mission, state, force, period) for state, force in moved])
        self.k += 1

    def aims(self) -> np.ndarray:
        """Forces with which each deputy's next stop would be where the next deputy's is, within the clip."""
        stop_places = self.states @ self.stops.T
        free = self.states @ (self.stops @ self.layer.phi).T
        gain = self.stops @ self.layer.gamma
        wanted = np.linalg.solve(gain, (np.roll(stop_places, -1, axis=0) - free).T).T
        return np.clip(wanted, -1.0, 1.0)

    def least(self) -> float:
        positions = self.states[:, :3]
        pairs = [np.linalg.norm(positions[i] - positions[:i], axis=1).min() for i in range(1, len(positions))]
        return float(min(pairs))


def drawn(mission, deputies: int, random: np.random.Generator, spread_m: float = 35.0) -> Fleet:
    """Fleets whose stops are apart and between the spheres, and can be stopped at."""
    while True:
        states = random.normal(0.0, [*[spread_m] * 3, *[0.1] * 3], (deputies, 6))
        states[:, 0] += 2.0 * (35.0 - spread_m)
        fleet = Fleet(mission, states)
        stop_places = states @ fleet.stops.T
        gaps = [np.linalg.norm(stop_places[i] - stop_places[:i], axis=1).min() for i in range(1, deputies)]
        if min(gaps) >= APART_M and all(fleet.layer.excesses(state, 2).max() < 0.0 for state in states):
            return fleet


def attacks(deputies: int, link: str, number: int, seed: int) -> Iterator[tuple[Fleet, Fleet, int]]:
    """Yield fleets that attack themselves, after each control period: corrected, not so, and how many were.

    Two thirds of them aim at one another throughout; in the others random forces come between.
    """
    words, share = LINKS[link]
    mission, random = mission_of(deputies, *words), np.random.default_rng([seed, deputies])
    for attack in range(number):
        start = drawn(mission, deputies, random)
        draws = np.random.default_rng([seed, attack]).random((1, PERIODS, deputies, deputies))
        fleet = Fleet(mission, start.states, (draws < share).astype(np.uint8) if share else NO_LOSSES)
        alone = Fleet(mission, fleet.states.copy())
        for k in range(PERIODS):
            wanted = fleet.aims() if attack % 3 or k % 4 else random.uniform(-1.0, 1.0, (deputies, 3))
            forces = fleet.corrected(wanted)
            fleet.move(forces)
            alone.move(alone.aims())
            yield fleet, alone, int(np.abs(forces - wanted).max() > 1e-6)
