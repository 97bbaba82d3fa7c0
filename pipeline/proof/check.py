"""Check a proof: ``python -m pipeline.proof.check FOLDER``, a run's folder with ``prove/`` in it.

Shares no code with what made the proof. All numbers are balls of FLINT (Johansson, IEEE Transactions on
Computers 66, 2017), whose operations hold every result that is possible for real numbers inside them.
"""

import hashlib
import json
import sys
from bisect import bisect_left, bisect_right
from collections import namedtuple
from functools import cache, reduce
from itertools import accumulate, pairwise, product
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from flint import arb, arb_mat, ctx

#: a box along an axis, of positions p and of velocities v + shear p, where the force is constant + a p + b v,
#: give or take the residual
Row = namedtuple("Row", "step axis low high least greatest shear constant a b residual")
AXES = (("x", "radial"), ("y", "along_track"), ("z", "cross_track"))
CORNERS = ("left", "peak", "right")
SENTENCE = """checked: from every start between {start_low} and {start_high} (m, m/s),
with the controller of SHA-256 {controller_sha256}, {mass_kg} kg,
{max_force_n} N an axis and {mean_motion_rad_s} rad/s, speeds stay below base + slope (distance - offset),
{limit} (m/s, 1/s, m), at all times of {num_periods} periods of {period_s} s,
after which distance and speed are at most {goal} (m, m/s)
"""


class Refused(ValueError):  # noqa: N818 - the sentence is the message
    """A certificate that proves nothing; the text says where it fails."""


def need(holds: bool, fault: str) -> None:
    """Raise Refused unless something certainly holds."""
    if not holds:
        raise Refused(fault)


def ball(low: Any, high: Any) -> Any:
    """Return a ball that holds an interval."""
    return arb(low).union(arb(high))


def held(one: Row) -> tuple[Any, Any, Any]:
    """Return the positions, velocities and forces of a box."""
    p, s = ball(one.low, one.high), ball(one.least, one.greatest)
    force = one.constant + (one.a - arb(one.b) * one.shear) * p + one.b * s + arb(0, one.residual)
    return p, s - one.shear * p, force


class Force:
    """The force along an axis, of a system whose output terms are equal triangles, side by side.

    Cut, each has its peak as its centroid, and an area of 1 - (1 - cut)^2 of the whole one.
    """

    def __init__(self, controller: Any, axis: int, cells: list[int], most: float) -> None:
        letter, along = AXES[axis]
        self.most = arb(most)
        self.band = float(controller["attributes"].get(f"dead_band_force_{letter}_n", 0))
        (system,) = (each for each in controller["systems"] if each["name"] == f"force_{letter}")
        inputs, (output,) = system["inputs"], system["outputs"]
        kind = [
            *(v["name"] for v in inputs),
            *map(system.get, ("and_operator", "or_operator", "defuzzifier")),
        ]
        wanted = [f"position_{along}", f"velocity_{along}", "min", "max", "centroid"]
        need(kind == wanted, "a system of another kind than Mamdani's, or of other inputs")
        for v in (*inputs, output):
            (low, high), pieces = v["range"], v["points"] - 1
            corners = [(t[key] - low) / (high - low) * pieces for t in v["terms"] for key in CORNERS]
            off = [abs(x - round(x)) for x in corners if 0 <= x <= pieces]
            need(max(off, default=0.0) < 1e-6, "a corner between points of the universe")
        even = [pieces / len(corners) * 1.5 * (2 * (i // 3) + i % 3) for i in range(len(corners))]
        need(all(abs(x - y) < 1e-6 for x, y in zip(corners, even, strict=True)), "uneven output terms")
        self.peaks = {t["name"]: arb(t["peak"]) for t in output["terms"]}
        self.rules = list(zip(product(*(v["terms"] for v in inputs)), system["rules"], strict=True))
        self.edges, clipped = [], []
        for (low, high), count in zip((v["range"] for v in inputs), cells, strict=True):
            inner = [low + (high - low) * (i / count) for i in range(count + 1)]
            self.edges.append([-1e6, *inner, 1e6])
            clipped.append([ball(*pair) for pair in pairwise([low, *inner, high])])
        self.cell = cache(lambda i, j: self.at(clipped[0][i], clipped[1][j]))

    def at(self, *values: Any) -> Any:
        """Return the force for balls of the inputs, inside their ranges."""
        cuts = dict.fromkeys(self.peaks, arb(0))
        for conditions, word in self.rules:
            strength = arb(1)
            for t, x in zip(conditions, values, strict=True):
                left, peak, right = (arb(t[key]) for key in CORNERS)
                strength = strength.min((x - left) / (peak - left)).min((right - x) / (right - peak))
            cuts[word] = cuts[word].max(strength)
        peaks, means = list(self.peaks.values()), []
        low, high = ([1 - (1 - end(cut)) ** 2 for cut in cuts.values()] for end in (arb.lower, arb.upper))
        for first, last in (
            (low, high),
            (high, low),
        ):  # an extreme mean weighs one side most, the other least
            for place in range(1, len(peaks)):
                weights = [*first[:place], *last[place:]]
                means.append(sum(w * p for w, p in zip(weights, peaks, strict=True)) / sum(weights))
        force = reduce(arb.union, means)
        if not abs(force) > self.band:
            force = arb(0) if abs(force) < self.band else force.union(arb(0))
        return force.min(self.most).max(-self.most)

    def check(self, one: Row) -> None:
        """Raise Refused unless the force lies within the residual of a box's plane, cell by cell."""
        ps, vs = self.edges
        for column in range(bisect_right(ps, one.low) - 1, bisect_left(ps, one.high)):
            p = max(ps[column], one.low), min(ps[column + 1], one.high)
            lean = sorted(one.shear * end for end in p)
            room = 1e-11 * (1.0 + abs(one.shear))  # for rounding of the two sums
            least, greatest = one.least - lean[1] - room, one.greatest - lean[0] + room
            linear = one.constant + one.a * ball(*p)
            for row in range(bisect_right(vs, least) - 1, bisect_left(vs, greatest)):
                plane = linear + one.b * ball(max(vs[row], least), min(vs[row + 1], greatest))
                need(abs(self.cell(column, row) - plane) <= one.residual, f"the residual of {one}")


def effects(theorem: Any) -> list[list[Any]]:
    """Return the effect of positions, velocities and forces after a period: Clohessy and Wiltshire, 1960."""
    n, mass = arb(theorem["mean_motion_rad_s"]), arb(theorem["mass_kg"])
    rates = [[arb(0)] * 9 for _ in range(9)]
    for axis in range(3):
        rates[axis][axis + 3], rates[axis + 3][axis + 6] = arb(1), 1 / mass
    rates[3][0], rates[3][4], rates[4][3], rates[5][2] = 3 * n**2, 2 * n, -2 * n, -(n**2)
    return list((arb_mat(rates) * arb(theorem["period_s"])).exp().tolist())


def covered(at: Any, leaning: Any, boxes: list[Row]) -> None:
    """Raise Refused unless boxes side by side hold positions, and each the velocities + shear position."""
    hits = [t for t in boxes if not (t.low > at or t.high < at)]
    need(bool(hits) and hits[0].low <= at and max(t.high for t in hits) >= at, "a position outside the tube")
    ends = accumulate((t.high for t in hits), max)
    need(all(end >= t.low for end, t in zip(ends, hits[1:], strict=False)), "a gap in the tube")
    for t in hits:
        need(t.least <= leaning(t) and leaning(t) <= t.greatest, f"a velocity outside {t}")


def happens(boxes: dict[int, list[Row]], most: Any) -> list[Any]:
    """Return nine balls, of the positions, velocities and forces along each axis."""
    found = [arb(0)] * 9
    for a, rows in boxes.items():
        found[a::3] = [reduce(arb.union, balls) for balls in zip(*map(held, rows), strict=True)]
        found[a + 6] = found[a + 6].min(most).max(-most)
    return found


def move(matrix: Any, a: int, one: Row, now: list[Any], after: list[Row]) -> None:
    """Raise Refused unless a period leads from a box into those after it."""
    lines = []
    for line in (matrix[a], matrix[a + 3]):
        own, on_s, thrust = line[a], line[a + 3] + line[a + 6] * one.b, line[a + 6]
        push = sum(line[c] * now[c] for c in range(9) if c % 3 != a)
        rest = thrust * (one.constant + arb(0, one.residual)) + push
        lines.append((own + thrust * one.a - on_s * one.shear, on_s, rest))

    def image(shear: float, of_velocity: int) -> Any:
        on_p, on_s, rest = (of_velocity * v + shear * p for p, v in zip(*lines, strict=True))
        return on_p * ball(one.low, one.high) + on_s * ball(one.least, one.greatest) + rest

    at, v = image(1.0, 0), image(0.0, 1)

    def leaning(t: Row) -> Any:
        return image(t.shear, 1).intersection(v + t.shear * at.intersection(ball(t.low, t.high)))

    covered(at, leaning, after)


def limit(theorem: Any, now: list[Any], after: list[Any]) -> None:
    """Raise Refused unless the limit holds from a sample to the next; h^2/8 bounds the bend between them."""
    n, h, most = (arb(theorem[key]) for key in ("mean_motion_rad_s", "period_s", "max_force_n"))
    thrust = most / theorem["mass_kg"]
    far, fast = (reduce(arb.max, (abs(x).upper() for x in now[k : k + 3])) for k in (0, 3))
    fast += 2 * h * thrust
    need(thrust + 3 * n**2 * (far + h * fast) + 2 * n * fast <= 2 * thrust, "gravity beside the thrust")
    swept = [one.union(other) for one, other in zip(now, after, strict=True)]
    near = [(abs(x) - h**2 / 4 * thrust).lower().max(arb(0)) for x in swept[:3]]
    speed = [abs(x).upper() + h**2 / 8 * (3 * n**2 * fast + 4 * n * thrust) for x in swept[3:6]]
    base, slope, offset = map(arb, theorem["limit"])
    distance = sum(x**2 for x in near).sqrt()
    need(sum(x**2 for x in speed).sqrt() <= base + slope * (distance - offset), "the limit")


def check(folder: Path) -> str:
    """Return what the certificate of a folder proves.

    Raises
    ------
    Refused
        If it proves nothing.
    """
    ctx.prec = 100
    theorem = json.loads((folder / "theorem.json").read_bytes())
    text = (folder / "controller.json").read_bytes()
    need(hashlib.sha256(text).hexdigest() == theorem["controller_sha256"], "another controller")
    controller, matrix, most = json.loads(text), effects(theorem), theorem["max_force_n"]
    others = set(controller["attributes"]) - {f"dead_band_force_{letter}_n" for letter, _ in AXES}
    need(others == {"force_axes"}, "attributes other than dead bands and the axes of forces")
    need(controller["attributes"]["force_axes"] == "hill", "forces along axes other than Hill's")
    start = list(zip(theorem["start_low"], theorem["start_high"], strict=True))
    forces = {a: Force(controller, a, theorem["cells"], most) for a in range(3)}
    for a in [a for a in forces if not any((*start[a], *start[a + 3]))]:
        need(abs(forces.pop(a).at(arb(0), arb(0))) <= 0, "flights that leave the plane")
    tube: list[dict[int, list[Row]]] = [{a: [] for a in forces} for _ in range(theorem["num_periods"] + 1)]
    for one in sorted(Row(*each.values()) for each in pq.read_table(folder / "tube.parquet").to_pylist()):
        is_placed = one.step in range(len(tube)) and one.axis in forces
        need(is_placed and all(abs(x) < 1e4 for x in one), f"the place or size of {one}")
        tube[int(one.step)][int(one.axis)].append(one)
    for a, first in tube[0].items():
        v = ball(*start[a + 3])
        covered(ball(*start[a]), lambda t, v=v: v + t.shear * ball(t.low, t.high), first)
    balls = [happens(boxes, arb(most)) for boxes in tube]
    for k, (boxes, after) in enumerate(pairwise(tube)):
        for a, one in ((a, one) for a, rows in boxes.items() for one in rows):
            forces[a].check(one)
            move(matrix, a, one, balls[k], after[a])
        limit(theorem, *balls[k : k + 2])
    for k, goal in enumerate(theorem["goal"]):
        need(sum(abs(x).upper() ** 2 for x in balls[-1][3 * k : 3 * k + 3]).sqrt() <= goal, "the goal")
    return SENTENCE.format(**theorem)


if __name__ == "__main__":
    try:
        sys.stdout.write(check(Path(sys.argv[1]) / "prove"))
    except (ValueError, KeyError) as error:
        sys.exit(f"refused: {error}")
