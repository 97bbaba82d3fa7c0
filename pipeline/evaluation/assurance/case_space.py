"""The random variables of a case as genes between 0 and 1, for searches and for how rare an event is.

In a case of a fleet each deputy has a start of its own, and the Sun is the same for all.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.array_types import Floats
from pipeline.evaluation.paired_runs import of_deputy
from pipeline.flight.state.log import Scenario
from pipeline.settings.dispersions import Distribution, distributions
from pipeline.settings.experiment import Experiment, Sun
from pipeline.settings.fleet import SEED_STEP
from pipeline.settings.monte_carlo import MonteCarlo

#: share of a dispersed setting's values at either end that a search excludes: three standard deviations
TAIL = 0.00135
#: genes that are shares of a turn, of any deputy, and those of a start from a box
ANGLES = ("azimuth", "heading_azimuth", "sun_angle")
COORDINATES = ("x", "y", "z", "x_rate", "y_rate", "z_rate")


@dataclass(frozen=True)
class CaseSpace:
    """The random variables of a case: its start, the Sun unless fixed, and dispersed settings.

    Parameters
    ----------
    starts : MonteCarlo
        What starts are drawn from: a box of positions and velocities, or a shell of distances, with speeds
        up to a maximum.
    sun : Sun
    dispersed : tuple of Distribution
        Sorted by their keys; a gene chooses a quantile from `TAIL` to ``1 - TAIL``.
    turned : mapping of str to float
        Shifts of angles from their genes, as shares of a turn.
    deputies : int
        Of a fleet.
    parked_rad_s : float
        The mean motion, where starts move along the track by -2 n x; 0 where they do not.
    is_exact : bool
        Whether uniform genes give the very law of the evaluation's cases: with the tails of dispersed
        settings, its choice of directions, and a Sun that is fixed in half of the cases. Searches do without.
    """

    starts: MonteCarlo
    sun: Sun
    dispersed: tuple[Distribution, ...] = ()
    turned: Mapping[str, float] = field(default_factory=dict)
    deputies: int = 1
    parked_rad_s: float = 0.0
    is_exact: bool = False

    @property
    def genes(self) -> tuple[str, ...]:
        """Names of a case's genes, in order; each is from 0 to 1."""
        angle = () if self.sun.mode == "fixed" else ("sun_angle",)
        ranges = self.sun.mode != "fixed" and self.sun.elevation_range_deg is not None
        elevation = ("sun_elevation",) if ranges else ()
        kind = ("sun_kind",) if self.is_exact and self.sun.mode == "mixed" else ()
        dispersed = (distribution.key for distribution in self.dispersed)
        others = (
            of_deputy(name, number) for number in range(2, self.deputies + 1) for name in self._of_start
        )
        return (*self._of_start, *angle, *elevation, *kind, *dispersed, *others)

    @property
    def is_periodic(self) -> NDArray[np.bool_]:
        """Whether a gene's ends are neighbours, (num_genes,)."""
        angles = self._angles
        return np.array([name in angles for name in self.genes], dtype=np.bool_)

    @property
    def _angles(self) -> frozenset[str]:
        """The names of genes that are shares of a turn."""
        numbers = range(1, self.deputies + 1)
        return frozenset(of_deputy(name, number) for name in ANGLES for number in numbers)

    @property
    def _of_start(self) -> tuple[str, ...]:
        """Return the names of the genes that place the start: of a box, or of a shell."""
        if self.starts.box is not None:
            ranges = zip(COORDINATES, *self.starts.box, strict=True)
            return tuple(name for name, low, high in ranges if low < high)
        moving = ("heading_height", "heading_azimuth", "speed") if self.starts.max_speed_m_s > 0.0 else ()
        return ("height", "azimuth", "distance", *moving)

    def centred_on(self, genes: Floats) -> tuple["CaseSpace", Floats]:
        """Return this space shifted so that the angles of some genes are central, and the shifted genes.

        A search that begins there does not run into the ends of an angle's range.
        """
        moved, turned = genes.copy(), dict(self.turned)
        for gene, name in enumerate(self.genes):
            if name in self._angles:
                turned[name] = turned.get(name, 0.0) + genes[gene] - 0.5
                moved[gene] = 0.5
        return replace(self, turned=turned), moved

    def scenario(self, genes: Floats) -> Scenario:
        """Return the case that genes, (num_genes,), encode.

        Uniform genes give starts that are isotropic and uniform in distance.
        """
        values = dict(zip(self.genes, genes.tolist(), strict=True))
        values |= {name: value + self.turned.get(name, 0.0) for name, value in values.items()}
        angle, elevation_deg = np.radians(self.sun.angle_deg), self.sun.elevation_deg
        is_fixed = values.get("sun_kind", 1.0) < 0.5
        if "sun_angle" in values and not is_fixed:
            angle = 2.0 * np.pi * (values["sun_angle"] % 1.0)
        if self.sun.elevation_range_deg is not None and "sun_elevation" in values and not is_fixed:
            low, high = self.sun.elevation_range_deg
            elevation_deg = low + values["sun_elevation"] * (high - low)
        tail = 0.0 if self.is_exact else TAIL
        settings = tuple(
            distribution.value(tail + (1.0 - 2.0 * tail) * values[distribution.key])
            for distribution in self.dispersed
        )
        sun = float(angle), float(np.radians(elevation_deg))
        first, *others = (
            Scenario(*self._start({name: values[of_deputy(name, number)] for name in self._of_start}), *sun)
            for number in range(1, self.deputies + 1)
        )
        return numbered(replace(first, settings=settings or None, others=tuple(others)), first.noise)

    def _start(self, values: Mapping[str, float]) -> tuple[Floats, Floats]:
        """Return the position (m) and the velocity (m/s) of a start."""
        starts = self.starts
        if starts.box is not None:
            low, high = np.array(starts.box)
            state = low + (high - low) * [values.get(name, 0.0) for name in COORDINATES]
            return state[:3], state[3:]
        shell_m = starts.max_distance_m - starts.min_distance_m
        position = (starts.min_distance_m + shell_m * values["distance"]) * self._direction(
            values["height"], values["azimuth"]
        )
        if self.parked_rad_s > 0.0:
            return position, np.array([0.0, -2.0 * self.parked_rad_s * float(position[0]), 0.0])
        if "speed" not in values:
            return position, np.zeros(3)
        heading = self._direction(values["heading_height"], values["heading_azimuth"])
        return position, starts.max_speed_m_s * values["speed"] * heading

    def _direction(self, height: float, azimuth: float) -> Floats:
        """Return the unit vector at a height, a share of the way from -z to +z, and a share of a turn."""
        z, turn = 2.0 * height - 1.0, 2.0 * np.pi * azimuth
        if self.is_exact and self.starts.directions == "angles":
            z = np.sin(0.5 * np.pi * z)
        across = np.sqrt(max(0.0, 1.0 - z * z))
        return np.array([across * np.cos(turn), across * np.sin(turn), z])


def case_space(experiment: Experiment, *, is_exact: bool = False) -> CaseSpace:
    """Return the random variables of the cases of an experiment's evaluation."""
    mission, starts = experiment.mission, experiment.monte_carlo
    return CaseSpace(
        starts,
        experiment.sun,
        distributions(mission.dispersions),
        deputies=mission.fleet.deputies,
        parked_rad_s=mission.orbit.mean_motion_rad_s if starts.parked else 0.0,
        is_exact=is_exact,
    )


def numbered(case: Scenario, noise: tuple[int, int, int]) -> Scenario:
    """Return a case with the errors of a seed, a stage and a number; those of further deputies are others."""
    seed, stage, number = noise
    others = (
        replace(other, noise=(seed + SEED_STEP * deputy, stage, number))
        for deputy, other in enumerate(case.others, start=1)
    )
    return replace(case, noise=noise, others=tuple(others))
