"""Settings of the safety layer: off unless chosen, and refused where they could guard nothing."""

from dataclasses import replace

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.settings.experiment import Mission, Safety, SettingError
from tests.pipeline.flight.cases import mission
from tests.pipeline.flight.guarded import EARLY, guarded


def composed(*overrides: str) -> Mission:
    return compose_experiment(["+experiment=evaluate", "controller=coast", *overrides]).experiment.mission


def test_the_options() -> None:
    assert composed().safety.kind == "none"
    assert mission().safety == Safety()
    on, passive = composed("safety=filter"), composed("safety=passive")
    assert (on.keep_out_m, on.keep_in_m) == (16.0, 198.0)
    # one orbit is 2 pi / n = 5,677 s; otherwise the two are the same
    assert passive.safety == replace(on.safety, passive_horizon_s=5677.0)
    assert composed("safety=none") == replace(on, safety=replace(on.safety, kind="none"))


MISTAKES = [
    ({"keep_out_margin_m": 0.0}, {}, "safety.keep_out_margin_m is 0.0; it must be at least 0.001 (m)"),
    ({"keep_out_margin_m": 190.0}, {}, "is 205.0 and deputy.max_distance_m less safety.keep_in_margin_m is"),
    ({"braking_force_n": 1.1}, {}, "safety.braking_force_n is 1.1; it must be from 0 to 1 (N)"),
    ({"braking_force_n": 0.008}, {}, "to stand still 198 m above the chief takes 0.00873 N; raise it"),
    (
        {"speed_distance_m": 100.0},
        {},
        "allow -0.172 m/s at the keep-out sphere (16 m); it must be at least 0",
    ),
    ({}, {"min_distance_m": 197.5}, "the first must be less than the second (m)"),
]


@pytest.mark.parametrize(("safety", "deputy", "message"), MISTAKES)
def test_what_could_guard_nothing_is_refused(safety: dict, deputy: dict, message: str) -> None:
    with pytest.raises(SettingError) as refusal:
        guarded(replace(EARLY, **safety), deputy=deputy)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_layer_that_is_off_refuses_no_limits() -> None:
    """Its numbers count only where it is on: other missions need not fit them."""
    off = replace(EARLY, kind="none")
    assert guarded(off, deputy={"min_distance_m": 197.5}).safety == off
