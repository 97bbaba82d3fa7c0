"""Decisions of foresight, with the plans they were made among: in words, and as recordings keep them."""

from collections.abc import Iterator

import numpy as np

from pipeline.array_types import Floats
from pipeline.constants import MM_PER_M
from pipeline.flight.fly.replanning import COASTING, ENDS, FINISHING, REHEARSED, RULES
from pipeline.flight.state.log import FlightLog
from pipeline.flight.world.pack import pack_world
from pipeline.physics.motion import repeated
from pipeline.physics.transitions import follows_course
from pipeline.settings.experiment import Mission
from telemetry.file.metadata import Rehearsal

#: what pushes along the positive and the negative Hill axes are called
WAYS = (("up", "down"), ("ahead", "back"), ("north", "south"))
#: a component smaller than this is not named, mm/s
LEAST_MM_S = 0.5
#: seconds between the positions of a plan's path that are recorded
PATH_PERIOD_S = 60.0


def is_planned(log: FlightLog) -> bool:
    """Return whether a flight went by plans of pushes, not by what its rules rehearse."""
    return len(log.foresight_at) > 0 and not len(log.push_costs_m_s) and not len(log.tour_costs_m_s)


def push_of(mission: Mission, force_n: Floats) -> Floats:
    """Return what forces that are held for a control period, N, change velocities by, mm/s; of any shape."""
    return MM_PER_M * mission.control_period_s / mission.deputy.mass_kg * np.asarray(force_n)


def along_axes(push_mm_s: Floats) -> str:
    """Return the components of a push, mm/s along Hill axes, (3,), in words, axis by axis."""
    x, y, z = push_mm_s.tolist()
    return f"{x:.0f} mm/s radially, {y:.0f} along the track, {z:.0f} across"


def push_in_words(push_mm_s: Floats) -> str:
    """Return a push, mm/s along Hill axes, in words, the largest component first."""
    order = np.argsort(-np.abs(push_mm_s), kind="stable")
    parts = [
        f"{abs(push_mm_s[axis]):.0f} {WAYS[axis][int(push_mm_s[axis] < 0.0)]}"
        for axis in order.tolist()
        if abs(push_mm_s[axis]) >= LEAST_MM_S
    ]
    return ", ".join(parts).replace(" ", " mm/s ", 1)


def plan_in_words(mission: Mission, plan: Floats, sample: int) -> str:
    """Return a plan in words, with times from a sample on.

    A row of a plan, (B, 4), is a push: the sample when it begins, -1 for none, and its force, N, Hill axes.
    """
    words = []
    for begin, *force in plan[np.argsort(plan[:, 0], kind="stable")]:
        push = push_in_words(push_of(mission, np.array(force))) if begin >= 0.0 else ""
        minutes = (begin - sample) * mission.control_period_s / 60.0
        if push:
            words.append(f"{push} {'now' if begin == sample else f'after {minutes:.1f} min'}")
    return "; ".join(words) or "no push"


def decisions_in_words(mission: Mission, log: FlightLog) -> Iterator[tuple[int, str]]:
    """Yield the sample and a sentence for each decision of foresight."""
    for at, plans, prices, ends in zip(
        log.foresight_at, log.foresight_plans, log.foresight_prices_m_s, log.foresight_ends_m_s, strict=True
    ):
        sample, num_priced, missed = (int(number) for number in at)
        plan = plan_in_words(mission, plans[0], sample)
        sentence = f"planned: the last plan still sees enough, {plan}"
        if num_priced:
            sentence = (
                f"planned: of {num_priced:,} plans, checked for light and sight, the cheapest is {plan}"
            )
        if np.isfinite(prices[1]):
            other, more = plan_in_words(mission, plans[1], sample), MM_PER_M * (prices[1] - prices[0])
            sentence += f". The best that differs clearly, {other}, would cost {more:.0f} mm/s more"
        best = int(np.nanargmin(ends))
        then = {
            COASTING: "coasting follows",
            FINISHING: "the rules finish",
            RULES: "but the rules alone are cheaper",
            REHEARSED: "but what the rules rehearse is cheaper",
        }[best]
        unseen = f"{missed} point{'s' * (missed != 1)} unseen"
        yield sample, f"{sentence}; {then}. Firing nothing from here would leave {unseen}"


def decision_at(mission: Mission, log: FlightLog, sample: int) -> str:
    """Return the last decision of foresight up to a sample in words; nothing where there is none."""
    return next((words for at, words in [*decisions_in_words(mission, log)][::-1] if at <= sample), "")


def recorded_decisions(mission: Mission, log: FlightLog, num_deputies: int = 1) -> dict[str, Rehearsal]:
    """Return the candidates of each decision, and the flights ahead, by what was chosen.

    Of a fleet they are the deputy's part in plans, with what these cost all.
    """
    period, rehearsals = mission.control_period_s, {}
    of_fleet = f" of {num_deputies} deputies" if num_deputies > 1 else ""
    planned = f"part in a plan{of_fleet}" if of_fleet else "plan of pushes"
    begins = (log.foresight_at[:, 0] * period).tolist()
    for row, begin in enumerate(begins):
        end = begins[row + 1] if row + 1 < len(begins) else mission.duration_s
        sample, num_priced, _ = (int(number) for number in log.foresight_at[row])
        later = f" from {begin:g} s" if begin else ""
        is_plan, is_flown = (
            np.isfinite(of[row]) for of in (log.foresight_prices_m_s, log.foresight_ends_m_s)
        )
        plans = log.foresight_plans[row][is_plan]
        paths = [_path(mission, log, sample, plan) for plan in plans]
        rehearsals[planned + later] = Rehearsal(
            names=tuple(plan_in_words(mission, plan, sample) for plan in plans),
            costs_m_s=tuple(log.foresight_prices_m_s[row][is_plan].tolist()),
            num_tried=max(num_priced, len(plans)),
            paths_m=tuple(np.round(np.array(paths), 1).ravel().tolist()),
            from_s=begin,
            until_s=end,
        )
        rehearsals[f"flight ahead{of_fleet}{later}"] = Rehearsal(
            names=tuple(name for name, was_flown in zip(ENDS, is_flown, strict=True) if was_flown),
            costs_m_s=tuple(log.foresight_ends_m_s[row][is_flown].tolist()),
            from_s=begin,
            until_s=end,
        )
    return rehearsals


def _path(mission: Mission, log: FlightLog, sample: int, plan: Floats) -> Floats:
    """Return the positions to which a plan leads from a sample on, by linear motion, (n, 3), m."""
    world = pack_world(mission)
    course = world.transitions
    known = np.r_[log.position_m[sample], log.velocity_m_s[sample]]
    if mission.navigation.mode == "fixes":
        known = log.estimate[sample]
    count = world.num_controls - sample
    if follows_course(course):
        constants, path = course.back[sample] @ known, np.empty((count + 1, 3))
        forces = np.zeros((count + 1, 3))
        for begin, *force in plan[(plan[:, 0] >= 0.0) & (plan[:, 0] < world.num_controls)]:
            forces[int(begin) - sample] += force
        for k in range(sample, world.num_controls + 1):
            path[k - sample] = course.onward[k, :3] @ constants
            if k < world.num_controls:
                constants = constants + course.back[k + 1] @ course.pushes[k] @ forces[k - sample]
        return path[:: max(1, round(PATH_PERIOD_S / mission.control_period_s))]
    motion = repeated(world.motion, max(1, count))
    path = np.vstack([known[:3], motion.transition[:count, :3] @ known])
    for begin, *force in plan:
        after = int(begin) - sample
        if begin >= 0.0 and after < count:
            path[after + 1 :] += motion.control[: count - after, :3] @ np.array(force)
    return path[:: max(1, round(PATH_PERIOD_S / mission.control_period_s))]
