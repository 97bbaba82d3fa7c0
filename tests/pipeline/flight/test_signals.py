"""The table of signals: where each stands, and what must be computed for it."""

import numpy as np
import pytest

from fis_tools.model import FuzzyController
from pipeline.flight.control.controller import from_fuzzy, law_of
from pipeline.flight.state.signals import (
    ANGLES,
    APPROACH,
    NOTHING,
    ORBIT,
    PREVIEW,
    SETTING,
    SIGNALS,
    URGENCY,
    Signal,
    slot,
)
from tests.pipeline.flight.cases import (
    FORESEEING,
    HURRYING,
    LOOKING_AHEAD,
    ORBITAL,
    SEEING,
    STEERING,
    leaning_system,
    mission,
)

BODY = (("force_axes", "body"),)


def test_a_signal_behind_the_last_needs_what_its_row_says(monkeypatch: pytest.MonkeyPatch) -> None:
    """It once was taken for urgent, whose constants it has not."""
    monkeypatch.setitem(SIGNALS, "added", Signal("m", "a signal that every flight knows", NOTHING))
    system = leaning_system("force_x", 0.02, ("added", "m", 100.0))
    law = law_of(from_fuzzy(FuzzyController("tried", (system,), BODY)), mission())
    assert law.signals[0, 0] == len(SIGNALS) - 1
    assert law.needs == NOTHING


@pytest.mark.parametrize(
    ("controller", "needs"),
    [
        (STEERING, ANGLES),
        (ORBITAL, ORBIT),
        (LOOKING_AHEAD, ORBIT | APPROACH),
        (FORESEEING, ORBIT | PREVIEW),
        (HURRYING, URGENCY),
        (SEEING, URGENCY | SETTING),
    ],
)
def test_what_must_be_computed_adds_up(controller, needs) -> None:
    assert law_of(controller, mission()).needs == needs


def test_signals_that_are_written_together_stand_together() -> None:
    first = slot("target_radial", "target_along_track", "target_cross_track")
    np.testing.assert_array_equal(
        [slot("target_along_track"), slot("target_cross_track")], [first + 1, first + 2]
    )
    with pytest.raises(ValueError, match="put their rows together"):
        slot("target_radial", "target_cross_track")
