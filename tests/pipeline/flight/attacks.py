"""Deputies that aim at one another: what the product corrects, moved by SciPy's matrix exponential.

With errors, estimates and fired forces are as far off as the bounds say that they may be.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from fis_tools.engines.kernel import LANES
from pipeline.command_line.config import compose_experiment
from pipeline.flight.fly.fleets import NO_LOSSES, apart_of, make_exchange
from pipeline.flight.fly.workspace import make_state
from pipeline.flight.period.act.apart import assure_apart
from pipeline.flight.reference.motion import pushed
from pipeline.flight.reference.safety import SafetyLayer
from pipeline.flight.state.arrays import Moment
from pipeline.flight.world.bounds import bounds_of, spheres_of
from pipeline.flight.world.estimates import estimate_errors
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


#: of missions where nothing is exact
ERRORS = ("world=leo", "safety=robust")


def mission_of(deputies: int, *words: str):
    fleet = (f"fleet.deputies={deputies}", f"fleet.keep_apart_m={APART_M:g}")
    return compose_experiment([*WORDS, *fleet, *words]).experiment.mission


class Errors:
    """Errors of a flight at the bounds of its mission: constant ones, or others in each control period."""

    def __init__(self, mission) -> None:
        bounds, layer = bounds_of(mission).errors, SafetyLayer(mission.of_each)
        self.share, self.force_n, known = bounds.share, bounds.force_n, estimate_errors(mission)
        looked_at = np.eye(6)[:3], np.eye(6)[3:], layer.checks[1], layer.stop
        rows = [*looked_at, layer.checks[1] @ layer.phi, layer.stop @ layer.phi]
        self._rows = [(each, known.bound(each, bounds.constant_m, bounds.risk)) for each in rows]
        self._spread = np.repeat([self._rows[0][1], self._rows[1][1]], 3)

    def of_states(self, count: int, random: np.random.Generator) -> np.ndarray:
        """What estimates are off, (count, 6), so far that some bound is just reached."""
        errors = random.normal(size=(count, 6)) * self._spread
        shares = [np.linalg.norm(errors @ rows.T, axis=1) / most for rows, most in self._rows]
        return errors / np.max(shares, axis=0)[:, np.newaxis]

    def of_thrusters(self, count: int, random: np.random.Generator) -> np.ndarray:
        """Linear errors, (count, 3, 3): less or more of a force, or any map."""
        maps = np.stack([-np.eye(3), np.eye(3), random.normal(size=(3, 3))])
        maps = maps[random.integers(3, size=count)]
        return self.share * maps / np.linalg.norm(maps, 2, axis=(1, 2))[:, np.newaxis, np.newaxis]

    def of_forces(self, count: int, random: np.random.Generator) -> np.ndarray:
        """What else forces are off, (count, 3), N."""
        errors = random.normal(size=(count, 3))
        return self.force_n * errors / np.linalg.norm(errors, axis=1)[:, np.newaxis]


@lru_cache
def errors_of(mission) -> Errors | None:
    return Errors(mission) if bounds_of(mission).errors.position_m else None


class Fleet:
    """Deputies whose commands are corrected by the product, and moved by SciPy's matrix exponential.

    `off` is what their estimates are off, (D, 6).
    """

    def __init__(self, mission, states: np.ndarray, lost=NO_LOSSES) -> None:
        self.mission, self.states, self.k, self.off = mission, states, 0, np.zeros_like(states)
        self._world, self._apart = pack_world(mission.of_each), apart_of(mission)
        self._link = make_exchange(self._world, mission.fleet, LANES, lost).link
        self._state = make_state(self._world, None)
        bounds = bounds_of(mission)
        self.planned_apart_m = APART_M + 2.0 * bounds.astray_m
        spheres, planned = spheres_of(mission, bounds), (bounds.planned_force_n, bounds.braking_force_n)
        margins = (*spheres, *np.minimum(planned, (mission.deputy.max_force_n, mission.braking_force_n)))
        self.layer = SafetyLayer(mission.of_each, (*margins, bounds.step_back_n))
        # P, from a state to the place of its stop
        self.stops = self.layer.checks[1]

    def corrected(self, forces: np.ndarray) -> np.ndarray:
        count, lanes, known = len(self.states), self._state, self.states + self.off
        for lane in range(lanes.belief.position.shape[1]):
            row = min(lane, count - 1)
            lanes.belief.position[:, lane], lanes.belief.velocity[:, lane] = np.split(known[row], 2)
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

    def plans(self) -> np.ndarray:
        """Where each plans to stop, (D, 3)."""
        return self._apart.plans[: len(self.states)]

    def least(self) -> float:
        positions = self.states[:, :3]
        pairs = [np.linalg.norm(positions[i] - positions[:i], axis=1).min() for i in range(1, len(positions))]
        return float(min(pairs))


def drawn(mission, deputies: int, random: np.random.Generator, spread_m: float = 35.0) -> Fleet:
    """Fleets whose stops are apart and between the spheres, and can be stopped at."""
    fleet, errors = Fleet(mission, np.zeros((deputies, 6))), errors_of(mission)
    while True:
        fleet.states = random.normal(0.0, [*[spread_m] * 3, *[0.1] * 3], (deputies, 6))
        fleet.states[:, 0] += max(0.0, 2.0 * (35.0 - spread_m))
        if errors is not None:
            fleet.off = errors.of_states(deputies, random)
        known = fleet.states + fleet.off
        stop_places = known @ fleet.stops.T
        gaps = [np.linalg.norm(stop_places[i] - stop_places[:i], axis=1).min() for i in range(1, deputies)]
        is_safe = all(fleet.layer.excesses(state, 2).max() < 0.0 for state in (*fleet.states, *known))
        if min(gaps) >= fleet.planned_apart_m and is_safe:
            return fleet


def attacks(
    deputies: int, link: str, number: int, seed: int, *words: str
) -> Iterator[tuple[Fleet, Fleet, int]]:
    """Yield fleets that attack themselves, after each control period: corrected, not so, and how many were.

    Two thirds of them aim at one another throughout; in the others random forces come between. Where a
    mission has errors, those of half the flights stay as they are.
    """
    sent, share = LINKS[link]
    mission, random = mission_of(deputies, *sent, *words), np.random.default_rng([seed, deputies])
    errors = errors_of(mission)
    for attack in range(number):
        start = drawn(mission, deputies, random, 35.0 if errors is None else 70.0)
        draws = np.random.default_rng([seed, attack]).random((1, PERIODS, deputies, deputies))
        fleet = Fleet(mission, start.states, (draws < share).astype(np.uint8) if share else NO_LOSSES)
        alone, fleet.off = Fleet(mission, fleet.states.copy()), start.off
        maps, others = np.zeros((deputies, 3, 3)), np.zeros((deputies, 3))
        for k in range(PERIODS):
            if errors is not None and (k == 0 or attack % 2):
                maps = errors.of_thrusters(deputies, random) if k == 0 else maps
                others = errors.of_forces(deputies, random)
                fleet.off = errors.of_states(deputies, random) if k > 0 else start.off
            wanted = fleet.aims() if attack % 3 or k % 4 else random.uniform(-1.0, 1.0, (deputies, 3))
            forces = fleet.corrected(wanted)
            fleet.move(forces + np.einsum("dij,dj->di", maps, forces) + others)
            alone.move(alone.aims())
            yield fleet, alone, int(np.abs(forces - wanted).max() > 1e-6)
