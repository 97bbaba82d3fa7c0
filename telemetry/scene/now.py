"""What a flight does at each instant, and why, in one line."""

import numpy as np

from telemetry.array_types import Floats
from telemetry.file import topics
from telemetry.file.reader import Recording

#: Hill axes: towards less, towards more
DIRECTIONS = (
    ("inwards", "outwards"),
    ("backwards", "forwards"),
    ("against the orbit normal", "along the orbit normal"),
)
#: a component smaller than this part of the largest is not told
WORTH_TELLING = 0.1
WHY = {
    "silent": "No rule asks for a force",
    "dead_band": "No burn: what the rules ask for is below the dead band",
    "below_least_impulse": "No burn: what the rules asked for is below the thrusters' least impulse",
    "delayed": "No burn yet: the thrusters fire what they are told later",
    "empty_tank": "No burn: the tank is empty",
    "waiting": "No burn until the next decision",
    "clipped": "at the thruster's limit",
    "safety": "changed by the safety layer",
}
#: reasons for which nothing is fired, the first that applies is told
AT_REST = (*("safety", "empty_tank", "below_least_impulse", "delayed", "dead_band", "waiting", "silent"),)
#: reasons that the line itself tells
ELSE = ("fired", "coasting", "complete")


def lines(recording: Recording, sample_time_s: Floats) -> list[str]:
    """Say what the controller does at each sample and why, with what is left to inspect.

    A recording gives reasons, or they follow from what it holds: whether a force was applied, whether the
    rules were asked, and whether every point is inspected.

    Parameters
    ----------
    recording : Recording
    sample_time_s : (N,)
        Times of the samples of the flight.
    """
    control, mission = recording[topics.DEPUTY_CONTROL], recording[topics.MISSION]
    places = np.maximum(np.searchsorted(mission.time_s, sample_time_s, side="right") - 1, 0)
    # recordings of earlier versions do not say how many can be inspected
    all_points = int(mission["inspectable_count"][-1]) or mission["inspected_mask"].shape[1]
    left = all_points - mission["inspected_count"].astype(np.int64)[places]
    names = [name for name in recording.fis_names if len(recording[topics.fis_topic(name)])]
    asked = {float(time) for name in names for time in recording[topics.fis_topic(name)].time_s}
    rows = {float(time): row for row, time in enumerate(control.time_s)}
    found = []
    for time, count in zip(sample_time_s.tolist(), left.tolist(), strict=True):
        row = rows.get(time)
        if row is None:
            found.append(
                f"The flight is over: {_points(count)}" if time >= control.time_s[-1:].max(initial=0) else ""
            )
        else:
            found.append(_line(recording, row, count, time in asked or not names))
    return found


def _line(recording: Recording, row: int, left: int, was_asked: bool) -> str:
    control = recording[topics.DEPUTY_CONTROL]
    force = control["force_hill_n"][row].astype(np.float64)
    reasons = [reason for reason in control["reason"][row].tolist() if reason in (*WHY, *ELSE)]
    if np.any(force):
        limits = [WHY[reason] for reason in ("clipped", "safety") if reason in reasons]
        words = [f"Firing {_force(force)}{_leader(recording, row)}", *limits]
        return ", ".join(words) + f": {_points(left)}"
    if "complete" in reasons or left == 0:
        return "Coasting: every point is inspected"
    if "coasting" in reasons or (not reasons and not was_asked):
        return f"Coasting: {_points(left)}{_foreseen(recording, row, left)}"
    why = next(
        (WHY[reason] for reason in AT_REST if reason in reasons),
        "No burn",
    )
    return f"{why}: {_points(left)}"


def _leader(recording: Recording, row: int) -> str:
    """Name the rule that pushes most the way of the largest output that is fired, where that is recorded.

    Rules that conclude no force hold back, and push no way, whatever their shares.
    """
    time = recording[topics.DEPUTY_CONTROL].time_s[row]
    found = []
    for name in recording.fis_names:
        topic, (fired, fired_s) = recording[topics.fis_topic(name)], recording.fired(name)
        holding = np.array(recording.fis_description(name).holding, dtype=np.intp) - 1
        for place in fired[fired_s == time].tolist():
            output, shares = float(topic["output_n"][place]), topic["shares_n"][place]
            pushes = np.sign(output) * shares
            pushes[holding] = 0.0
            if np.any(pushes > 0.0):
                found.append((abs(output), int(pushes.argmax()) + 1, name))
    return ", mostly by rule {} of {}".format(*max(found)[1:]) if found else ""


def _points(count: int) -> str:
    return f"{count} point{'' if count == 1 else 's'} left"


def _foreseen(recording: Recording, row: int, left: int) -> str:
    """Say how many of the points left will be seen if nothing is fired any more, where that is recorded."""
    control = recording[topics.DEPUTY_CONTROL]
    missed = control["coasting_missed"][row]
    if not np.isfinite(missed):
        return ""
    return ", all foreseen" if missed == 0 else f", {left - int(missed)} of them foreseen"


def _force(force: Floats) -> str:
    """Write a force as its size and where it pushes, the largest component first."""
    order = np.argsort(-np.abs(force))
    words = [
        DIRECTIONS[axis][int(force[axis] > 0)]
        for axis in order
        if abs(force[axis]) > WORTH_TELLING * abs(force[order[0]])
    ]
    return (
        f"{1e3 * np.linalg.norm(force):.3g} mN {', '.join(words[:-1])}{' and ' * (len(words) > 1)}{words[-1]}"
    )
