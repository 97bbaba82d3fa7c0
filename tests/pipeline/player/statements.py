"""What a page says of a flight, held against its log."""

import re

import numpy as np

from fis_tools.model.thrust import REASONS, SILENT_N
from pipeline.flight.goals.reach import until_end

#: reasons by their indices in logs, and those of what was not fired
NAMES = list(REASONS)
NOT_FIRED = [name for name, text in REASONS.items() if re.search(r"not fired|or fired|yet to fire", text)]
GIVEN = [f"{REASONS[name][:1].upper()}{REASONS[name][1:]}." for name in ("rehearsed", "parked")]


def assert_told(page, mission, controller, starts, logs, row):
    """Fail where the open flight's words contradict what the product logged of a row."""
    log = until_end(mission, logs[row])
    forces = np.where(np.abs(log.force_hill_n) < SILENT_N, 0.0, log.force_hill_n)
    rows = page.evaluate(
        "() => Array.from({ length: player.sides[0].flight.numSamples - 1 }, (_, k) =>"
        " player.sides[0].flight.reasons(k))"
    )
    assert len(rows) == len(forces)
    for k, (force, lines) in enumerate(zip(forces, rows, strict=True)):
        words = [NAMES[code] for code in log.reason[k]]
        said = {each["detail"] for each in lines}
        if force.any():
            assert len(lines) == np.count_nonzero(force), (k, lines)
            assert all(each["text"].startswith("Push ") for each in lines), (k, lines)
            assert said.isdisjoint(capital(REASONS[name]) for name in NOT_FIRED), (k, lines)
        elif lines[0]["text"] == "No push.":
            (text,) = said
            assert text in {capital(REASONS[name]) for name in words}, (k, lines, words)
            # what was given is not said of what was not fired yet
            assert text != capital(REASONS["silent"]) or set(words) == {"silent"}, (k, words)
            assert text not in GIVEN or set(words) <= {"rehearsed", "parked", "silent"}, (k, words)
        else:  # of the last decision
            assert lines[0]["text"].startswith("At "), (k, lines)
    buttons = page.locator("#player .bouts button").all_inner_texts()
    more = [re.search(r" and (\d+) more until ", text) for text in buttons]
    assert sum(int(match[1]) + 1 if match else 1 for match in more) == np.sum(forces.any(axis=1))
    assert buttons


def capital(text):
    return f"{text[:1].upper()}{text[1:]}."
