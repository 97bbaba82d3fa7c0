"""Check a proof: ``python -m pipeline.proof.check [FOLDER]``, of a run with ``prove/`` in it.

Shares no code with what made the proof. All numbers are balls of FLINT (Johansson, IEEE Transactions on
Computers 66, 2017), whose operations hold every result that is possible for real numbers inside them.
"""

import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from functools import cache, reduce
from itertools import pairwise, product
from pathlib import Path
from typing import Any, Final

from flint import arb, arb_mat, ctx

from pipeline.proof.certificate import AXES, CORNERS, ReceivedProof, TubeBox, read_proof
from pipeline.proof.strict import require

#: some rule fires at least as much everywhere: what no rule decides is not modelled
LEAST_STRENGTH: Final = 0.001
#: the cells of a force reach so far, m and m/s
BEYOND: Final = 1e6
#: of the whole command, while it reads
MEMORY_BYTES: Final = 1024**3
#: processor time, s, for a cell's force, for a cell of a box, and for a box beside one of the next period
SECONDS: Final = (1.5e-4, 1e-5, 1.5e-6)
#: more work than any proof of ours by a factor of a hundred
MAX_SECONDS: Final = 3600.0
USAGE: Final = """\
Usage: python -m pipeline.proof.check RUN_FOLDER

Check the proof in prove/ of a run's folder, by code that shares nothing with what made it.
The exit code is 0 if it is right, 1 if it is refused.
"""
SENTENCE: Final = """\
checked: from every start between {start_low} and {start_high} (m, m/s), with the controller of
SHA-256 {controller_sha256}, {mass_kg} kg, {max_force_n} N an axis and {mean_motion_rad_s} rad/s,
speeds stay below base + slope (distance - offset), {limit} (m/s, 1/s, m), at all times of
{num_periods} periods of {period_s} s, after which distance and speed are at most {goal} (m, m/s);
motion by Clohessy and Wiltshire's equations; {boxes} boxes, each over {fewest} to {most} cells of forces"""

#: along each axis that flights leave zero: the boxes at one time
Tube = dict[int, list[TubeBox]]


def ball(low: Any, high: Any) -> Any:
    """Return a ball that holds an interval."""
    return arb(low).union(arb(high))


def enclosures(box: TubeBox) -> tuple[Any, Any, Any]:
    """Return the positions, velocities and forces of a box."""
    p, sheared = ball(box.low, box.high), ball(box.least, box.greatest)
    force = box.constant + (box.per_position - arb(box.per_velocity) * box.shear) * p
    return p, sheared - box.shear * p, force + box.per_velocity * sheared + arb(0, box.residual)


def touched(edges: list[float], low: float, high: float) -> range:
    """Return the cells that hold an interval, at least one: a number on an edge lies in the cell after it."""
    first = bisect_right(edges, low) - 1
    return range(first, max(first + 1, bisect_left(edges, high)))


class Force:
    """The force along an axis, of a system whose output terms are equal triangles, side by side.

    Cut, each has its peak as its centroid, and an area of 1 - (1 - cut)^2 of the whole one.
    """

    def __init__(self, system: Any, dead_band_n: float, cells: list[int], greatest: Any) -> None:
        self.greatest, self.dead_band = greatest, dead_band_n
        (output,) = system["outputs"]
        self.peaks = {term["name"]: term["peak"] for term in output["terms"]}
        self.rules = list(zip(product(*(v["terms"] for v in system["inputs"])), system["rules"], strict=True))
        self.ranges = [v["range"] for v in system["inputs"]]
        self.edges, clipped = [], []
        for (low, high), num_cells in zip(self.ranges, cells, strict=True):
            inner = [low + (high - low) * (i / num_cells) for i in range(num_cells + 1)]
            self.edges.append([-BEYOND, *inner, BEYOND])
            clipped.append([ball(*pair) for pair in pairwise([low, *inner, high])])
        self.cell = cache(lambda i, j: self.at(clipped[0][i], clipped[1][j]))

    def at_rest(self) -> Any:
        """Return the force at position and velocity zero."""
        return self.at(*(arb(0).max(low).min(high) for low, high in self.ranges))

    def at(self, *values: Any) -> Any:
        """Enclose the force over balls of the inputs, inside their ranges."""
        cuts = dict.fromkeys(self.peaks.values(), arb(0))
        for terms, conclusion in self.rules:
            strength = arb(1)
            for term, x in zip(terms, values, strict=True):
                left, peak, right = (arb(term[key]) for key in CORNERS)
                strength = strength.min((x - left) / (peak - left)).min((right - x) / (right - peak))
            cuts[self.peaks[conclusion]] = cuts[self.peaks[conclusion]].max(strength)
        require(any(cut >= LEAST_STRENGTH for cut in cuts.values()), f"no rule surely fires at {values}")
        low, high = ([1 - (1 - end(cut)) ** 2 for cut in cuts.values()] for end in (arb.lower, arb.upper))
        # an extreme mean weighs one side most, the other least
        ends = [(*a[:k], *b[k:]) for a, b in ((low, high), (high, low)) for k in range(1, len(cuts))]
        force = reduce(arb.union, (sum(x * p for x, p in zip(w, cuts, strict=True)) / sum(w) for w in ends))
        if not abs(force) > self.dead_band:
            force = arb(0) if abs(force) < self.dead_band else force.union(arb(0))
        return force.min(self.greatest).max(-self.greatest)

    def span(self, box: TubeBox) -> tuple[range, range]:
        """Return the cells of positions and of velocities that a box touches, give or take rounding.

        A box holds positions p from low to high, m, and velocities v with v + shear p from least to
        greatest, m/s.
        """
        sheared = sorted((box.shear * box.low, box.shear * box.high))
        velocities = touched(self.edges[1], box.least - sheared[1], box.greatest - sheared[0])
        return touched(self.edges[0], box.low, box.high), velocities

    def check(self, box: TubeBox) -> int:
        """Return how many cells a box touches; refuse the certificate unless the plane holds over each.

        It holds where the force differs from it by at most the residual.
        """
        positions, velocities = self.edges
        num_cells = 0
        for column in touched(positions, box.low, box.high):
            p = ball(max(positions[column], box.low), min(positions[column + 1], box.high))
            v = (
                ball(box.least, box.greatest) - box.shear * p + arb(0, 1e-11)
            )  # wider than the rounding of its ends
            if not abs(v) < BEYOND:
                raise ValueError(f"velocities beyond all cells in {box}")
            for row in touched(velocities, float(v.lower()), float(v.upper())):
                inside = v.intersection(ball(velocities[row], velocities[row + 1]))
                plane = box.constant + box.per_position * p + box.per_velocity * inside
                if not abs(self.cell(column, row) - plane) <= box.residual:
                    raise ValueError(f"the residual of {box}")
                num_cells += 1
        return num_cells


def effects(theorem: Any) -> list[list[Any]]:
    """Return the effect of positions, velocities and forces after a period: Clohessy and Wiltshire, 1960."""
    n, mass = arb(theorem["mean_motion_rad_s"]), arb(theorem["mass_kg"])
    rates = [[arb(0)] * 9 for _ in range(9)]
    for axis in range(3):
        rates[axis][axis + 3], rates[axis + 3][axis + 6] = arb(1), 1 / mass
    rates[3][0], rates[3][4], rates[4][3], rates[5][2] = 3 * n**2, 2 * n, -2 * n, -(n**2)
    return list((arb_mat(rates) * arb(theorem["period_s"])).exp().tolist())


def require_covered(position: Any, sheared: Callable[[TubeBox], Any], boxes: list[TubeBox]) -> None:
    """Refuse the certificate unless boxes cover the positions without gaps, and their sheared velocities."""
    hits = [box for box in boxes if not (box.low > position or box.high < position)]
    require(bool(hits), "a position outside the tube")
    reached = arb(hits[0].low)
    is_held = hits[0].low <= position and max(box.high for box in hits) >= position
    require(is_held, "a position outside the tube")
    for box in hits:
        require(box.low <= reached, "a gap in the tube")
        reached = reached.max(arb(box.high))
        if not (box.least <= sheared(box) and sheared(box) <= box.greatest):
            raise ValueError(f"a velocity outside {box}")


def hull(tube: Tube, greatest: Any) -> list[Any]:
    """Return balls that contain all positions, velocities and forces of a period, (9,); zero on idle axes."""
    balls = [arb(0)] * 9
    for axis, boxes in tube.items():
        balls[axis::3] = [reduce(arb.union, each) for each in zip(*map(enclosures, boxes), strict=True)]
        balls[axis + 6] = balls[axis + 6].min(greatest).max(-greatest)
    return balls


def require_led(matrix: Any, axis: int, box: TubeBox, now: list[Any], after: list[TubeBox]) -> None:
    """Refuse the certificate unless each flight from a box is inside the next period's boxes."""

    def image(of_position: float, of_velocity: float) -> Any:
        line = [
            of_position * x + of_velocity * y for x, y in zip(matrix[axis], matrix[axis + 3], strict=True)
        ]
        on_position, on_velocity, on_force = line[axis::3]
        on_sheared = on_velocity + on_force * box.per_velocity
        on_position += on_force * box.per_position - on_sheared * box.shear
        along = on_position * ball(box.low, box.high) + on_sheared * ball(box.least, box.greatest)
        along += on_force * (box.constant + arb(0, box.residual))
        return sum((line[c] * now[c] for c in range(9) if c % 3 != axis), along)

    position, velocity = image(1.0, 0.0), image(0.0, 1.0)

    def sheared(other: TubeBox) -> Any:
        moved = velocity + other.shear * position.intersection(ball(other.low, other.high))
        return image(other.shear, 1.0).intersection(moved)

    require_covered(position, sheared, after)


def require_limit(theorem: Any, now: list[Any], after: list[Any]) -> None:
    """Refuse the certificate unless the limit holds from a sample to the next; h^2/8 bounds the bend."""
    n, h, greatest = (arb(theorem[key]) for key in ("mean_motion_rad_s", "period_s", "max_force_n"))
    thrust = greatest / theorem["mass_kg"]
    far, fast = (reduce(arb.max, (abs(x).upper() for x in now[k : k + 3])) for k in (0, 3))
    fast += 2 * h * thrust
    require(thrust + 3 * n**2 * (far + h * fast) + 2 * n * fast <= 2 * thrust, "gravity beside the thrust")
    swept = [x.union(y) for x, y in zip(now, after, strict=True)]
    distance = sum((abs(x) - h**2 / 4 * thrust).lower().max(arb(0)) ** 2 for x in swept[:3]).sqrt()
    bend = h**2 / 8 * (3 * n**2 * fast + 4 * n * thrust)
    speed = sum((abs(x).upper() + bend) ** 2 for x in swept[3:6]).sqrt()
    base, slope, offset = theorem["limit"]
    require(speed <= base + slope * (distance - offset), "the limit")


def tube_of(proof: ReceivedProof, axes: list[int]) -> list[Tube]:
    """Return the boxes of each period along some axes, at least one each."""
    num_periods = proof.theorem["num_periods"]
    require(num_periods < len(proof.boxes), f"{num_periods} periods and fewer boxes")
    tube: list[Tube] = [{axis: [] for axis in axes} for _ in range(num_periods + 1)]
    for box in proof.boxes:
        require(box.step in range(num_periods + 1) and box.axis in axes, f"the step or axis of {box}")
        tube[int(box.step)][int(box.axis)].append(box)
    for step, boxes in enumerate(tube):
        require(all(boxes.values()), f"no box after {step} periods along an axis")
    return tube


def expected_seconds(forces: dict[int, Force], tube: list[Tube]) -> float:
    """Estimate how long checking takes, s."""
    visits, cells = 0, 0
    for axis, force in forces.items():
        rows: dict[int, tuple[int, int]] = {}
        for box in (box for along in tube for box in along[axis]):
            across, inside = force.span(box)
            visits += len(across) * len(inside)
            for column in across:
                first, last = rows.get(column, (inside.start, inside.stop))
                rows[column] = min(first, inside.start), max(last, inside.stop)
        cells += sum(last - first for first, last in rows.values())
    pairs = sum(len(now[axis]) * len(after[axis]) for now, after in pairwise(tube) for axis in forces)
    return sum(cost * number for cost, number in zip(SECONDS, (cells, visits, pairs), strict=True))


def check(folder: Path, report: Callable[[str], object] = lambda text: None) -> str:
    """Check the certificate in a folder; return its theorem in words.

    Parameters
    ----------
    folder : Path
        With theorem.json, controller.json and tube.parquet.
    report : callable
        Receives a sentence on how long it will take.

    Raises
    ------
    ValueError
        If it proves nothing; the text says where it fails.
    OSError
        If a file is missing, too large or no regular file.
    """
    with ctx.workprec(100):
        return _check(read_proof(folder), report)


def _check(proof: ReceivedProof, report: Callable[[str], object]) -> str:
    """Check a certificate step by step; return what it proves, in words."""
    theorem = proof.theorem
    matrix, greatest = effects(theorem), arb(theorem["max_force_n"])
    start = list(zip(theorem["start_low"], theorem["start_high"], strict=True))
    forces = {
        axis: Force(proof.systems[axis], proof.dead_bands_n[axis], theorem["cells"], greatest)
        for axis in range(len(AXES))
    }
    # motion across the orbit's plane neither feels the other two nor acts on them
    if not any((*start[2], *start[5])):
        require(bool(forces.pop(2).at_rest() == 0), "flights that leave the plane")
    tube = tube_of(proof, list(forces))
    expected = expected_seconds(forces, tube)
    require(
        expected < MAX_SECONDS, f"checking takes about {expected / 3600:.0f} hours, for boxes over many cells"
    )
    report(f"{len(proof.boxes)} boxes to check: about {max(1.0, expected):.0f} s")
    for axis, first in tube[0].items():
        velocity = ball(*start[axis + 3])

        def sheared(box: TubeBox, velocity: Any = velocity) -> Any:
            return velocity + box.shear * ball(box.low, box.high)

        require_covered(ball(*start[axis]), sheared, first)
    balls = [hull(boxes, greatest) for boxes in tube]
    num_cells = []
    for step, (boxes, after) in enumerate(pairwise(tube)):
        for axis, box in ((axis, box) for axis, along in boxes.items() for box in along):
            num_cells.append(forces[axis].check(box))
            require_led(matrix, axis, box, balls[step], after[axis])
        require_limit(theorem, *balls[step : step + 2])
    num_checked = len(proof.boxes) - sum(map(len, tube[-1].values()))
    require(len(num_cells) == num_checked > 0 and min(num_cells) > 0, "boxes over no cell")
    for k, goal in enumerate(theorem["goal"]):
        require(sum(abs(x).upper() ** 2 for x in balls[-1][3 * k : 3 * k + 3]).sqrt() <= goal, "the goal")
    return SENTENCE.format(**theorem, boxes=len(num_cells), fewest=min(num_cells), most=max(num_cells))


def main(arguments: list[str]) -> int:
    """Check the proof of a run, and print what it proves."""
    if {"-h", "--help"} & {*arguments}:
        sys.stdout.write(USAGE)
        return 0
    import resource  # noqa: PLC0415 - not on every system

    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY_BYTES, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    try:
        text = check(Path(*arguments) / "prove", lambda line: sys.stderr.write(line + "\n"))
    except (
        ArithmeticError,
        AttributeError,
        LookupError,
        MemoryError,
        OSError,
        TypeError,
        ValueError,
    ) as error:
        sys.stderr.write(f"refused: {error or type(error).__name__}\n")
        return 1
    sys.stdout.write(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
