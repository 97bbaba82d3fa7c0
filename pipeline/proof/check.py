"""Check a proof: ``python -m pipeline.proof.check [FOLDER]``, of a run with ``prove/`` in it.

Shares no code with what made the proof. All numbers are balls of FLINT (Johansson, IEEE Transactions on
Computers 66, 2017), whose operations hold every result that is possible for real numbers inside them.
"""

import hashlib
import json
import sys
from bisect import bisect_left, bisect_right
from collections import namedtuple
from functools import cache, reduce
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from flint import arb, arb_mat, ctx

#: a box along an axis, of positions p and of velocities v + shear p, where the force is constant + a p + b v,
#: give or take the residual
Row = namedtuple("Row", "step axis low high least greatest shear constant a b residual")
AXES = (("x", "radial"), ("y", "along_track"), ("z", "cross_track"))
OPERATORS = {"and_operator": "min", "or_operator": "max", "defuzzifier": "centroid"}
CORNERS = ("left", "peak", "right")
SENTENCE = """checked: from every start between {start_low} and {start_high} (m, m/s), with the controller of
SHA-256 {controller_sha256}, {mass_kg} kg, {max_force_n} N an axis and {mean_motion_rad_s} rad/s,
speeds stay below base + slope (distance - offset), {limit} (m/s, 1/s, m), at all times of
{num_periods} periods of {period_s} s, after which distance and speed are at most {goal} (m, m/s)"""


def need(holds: bool, fault: str) -> None:
    """Refuse the certificate, by a ValueError that says where it fails, unless something certainly holds."""
    if not holds:
        raise ValueError(fault)


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

    def __init__(self, controller: Any, axis: int, cells: list[int], most: Any) -> None:
        letter, along = AXES[axis]
        self.most, self.band = most, float(controller["attributes"].get(f"dead_band_force_{letter}_n", 0))
        (system,) = (each for each in controller["systems"] if each["name"] == f"force_{letter}")
        inputs, (output,) = system["inputs"], system["outputs"]
        found = *(v["name"] for v in inputs), *map(system.get, OPERATORS)
        wanted = f"position_{along}", f"velocity_{along}", *OPERATORS.values()
        need(found == wanted, "a system of another kind than Mamdani's, or of other inputs")
        for v in (*inputs, output):
            (low, high), pieces = v["range"], v["points"] - 1
            corners = [(t[key] - low) / (high - low) * pieces for t in v["terms"] for key in CORNERS]
            need(all(abs(x - round(x)) < 1e-6 for x in corners if 0 <= x <= pieces), "a corner off its grid")
        even = [pieces / len(corners) * 1.5 * (2 * (i // 3) + i % 3) for i in range(len(corners))]
        need(all(abs(x - y) < 1e-6 for x, y in zip(corners, even, strict=True)), "uneven output terms")
        self.peaks = {t["name"]: t["peak"] for t in output["terms"]}
        self.rules = list(zip(product(*(v["terms"] for v in inputs)), system["rules"], strict=True))
        self.edges, clipped = [], []
        for (low, high), count in zip((v["range"] for v in inputs), cells, strict=True):
            inner = [low + (high - low) * (i / count) for i in range(count + 1)]
            self.edges.append([-1e6, *inner, 1e6])
            clipped.append([ball(*pair) for pair in pairwise([low, *inner, high])])
        self.cell = cache(lambda i, j: self.at(clipped[0][i], clipped[1][j]))

    def at(self, *values: Any) -> Any:
        """Return the force for balls of the inputs, inside their ranges."""
        cuts = dict.fromkeys(self.peaks.values(), arb(0))
        for terms, word in self.rules:
            strength = arb(1)
            for t, x in zip(terms, values, strict=True):
                left, peak, right = (arb(t[key]) for key in CORNERS)
                strength = strength.min((x - left) / (peak - left)).min((right - x) / (right - peak))
            cuts[self.peaks[word]] = cuts[self.peaks[word]].max(strength)
        low, high = ([1 - (1 - end(cut)) ** 2 for cut in cuts.values()] for end in (arb.lower, arb.upper))
        # an extreme mean weighs one side most, the other least
        ends = [(*a[:k], *b[k:]) for a, b in ((low, high), (high, low)) for k in range(1, len(cuts))]
        force = reduce(arb.union, (sum(x * p for x, p in zip(w, cuts, strict=True)) / sum(w) for w in ends))
        if not abs(force) > self.band:
            force = arb(0) if abs(force) < self.band else force.union(arb(0))
        return force.min(self.most).max(-self.most)

    def check(self, one: Row) -> None:
        """Refuse the certificate unless the force lies within the residual of a box's plane, cell by cell."""
        ps, vs = self.edges
        for column in range(bisect_right(ps, one.low) - 1, bisect_left(ps, one.high)):
            p = ball(max(ps[column], one.low), min(ps[column + 1], one.high))
            v = ball(one.least, one.greatest) - one.shear * p + arb(0, 1e-11)  # more than its ends' rounding
            for row in range(bisect_right(vs, float(v.lower())) - 1, bisect_left(vs, float(v.upper()))):
                plane = one.constant + one.a * p + one.b * v.intersection(ball(*vs[row : row + 2]))
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
    """Refuse the certificate unless boxes side by side hold positions, each velocities + shear position."""
    hits = [t for t in boxes if not (t.low > at or t.high < at)]
    need(bool(hits) and hits[0].low <= at and max(t.high for t in hits) >= at, "a position outside the tube")
    need(all(any(o.high >= t.low for o in hits[:k]) for k, t in enumerate(hits) if k), "a gap in the tube")
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
    """Refuse the certificate unless a period leads from a box into those after it."""

    def image(of_position: float, of_velocity: float) -> Any:
        line = [of_position * x + of_velocity * y for x, y in zip(matrix[a], matrix[a + 3], strict=True)]
        on_p, on_v, on_force = line[a::3]
        on_s = on_v + on_force * one.b
        on_p += on_force * one.a - on_s * one.shear
        own = on_p * ball(one.low, one.high) + on_s * ball(one.least, one.greatest)
        own += on_force * (one.constant + arb(0, one.residual))
        return sum((line[c] * now[c] for c in range(9) if c % 3 != a), own)

    at, v = image(1.0, 0.0), image(0.0, 1.0)

    def leaning(t: Row) -> Any:
        return image(t.shear, 1.0).intersection(v + t.shear * at.intersection(ball(t.low, t.high)))

    covered(at, leaning, after)


def limit(theorem: Any, now: list[Any], after: list[Any]) -> None:
    """Refuse the certificate unless the limit holds from a sample to the next; h^2/8 bounds the bend."""
    n, h, most = (arb(theorem[key]) for key in ("mean_motion_rad_s", "period_s", "max_force_n"))
    thrust = most / theorem["mass_kg"]
    far, fast = (reduce(arb.max, (abs(x).upper() for x in now[k : k + 3])) for k in (0, 3))
    fast += 2 * h * thrust
    need(thrust + 3 * n**2 * (far + h * fast) + 2 * n * fast <= 2 * thrust, "gravity beside the thrust")
    swept = [one.union(other) for one, other in zip(now, after, strict=True)]
    distance = sum((abs(x) - h**2 / 4 * thrust).lower().max(arb(0)) ** 2 for x in swept[:3]).sqrt()
    bend = h**2 / 8 * (3 * n**2 * fast + 4 * n * thrust)
    speed = sum((abs(x).upper() + bend) ** 2 for x in swept[3:6]).sqrt()
    base, slope, offset = theorem["limit"]
    need(speed <= base + slope * (distance - offset), "the limit")


def check(folder: Path) -> str:
    """Return what the certificate of a folder proves.

    Raises
    ------
    ValueError
        If it proves nothing; the text says where it fails.
    """
    ctx.prec = 100
    theorem = json.loads((folder / "theorem.json").read_bytes())
    text = (folder / "controller.json").read_bytes()
    need(hashlib.sha256(text).hexdigest() == theorem["controller_sha256"], "another controller")
    controller, matrix, most = json.loads(text), effects(theorem), arb(theorem["max_force_n"])
    rest = {key: value for key, value in controller["attributes"].items() if "dead_band_force_" not in key}
    need(rest == {"force_axes": "hill"}, "attributes other than dead bands and forces along Hill's axes")
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
        covered(ball(*start[a]), lambda t, a=a: ball(*start[a + 3]) + t.shear * ball(t.low, t.high), first)
    balls = [happens(boxes, most) for boxes in tube]
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
        sys.stdout.write(check(Path(*sys.argv[1:]) / "prove") + "\n")
    except (ArithmeticError, AttributeError, LookupError, OSError, TypeError, ValueError) as error:
        sys.exit(f"refused: {error}")
