"""Worlds: what they change, and the tables that tell who breaks in which."""

from dataclasses import replace

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation import comparison
from pipeline.evaluation.statistics import fraction
from pipeline.settings.experiment import SettingError
from pipeline.settings.schema import in_world


def row(controller: str, world: str, successes: int, outside: int, spent: float) -> comparison.ComparisonRow:
    summary = {
        "success_and_within_limits": vars(fraction([True] * successes + [False] * (100 - successes), 95.0)),
        "violated": vars(fraction([True] * outside + [False] * (100 - outside), 95.0)),
        "delta_v_m_s": {"mean": spent},
    }
    return comparison.ComparisonRow(
        controller, comparison.FLOWN, "random", "none", 100, None, summary, None, world
    )


ROWS = [
    row("a", "paper", 98, 0, 0.5), row("b", "paper", 80, 2, 0.4),
    row("a", "dark", 60, 0, 0.6), row("b", "dark", 78, 3, 0.4),
    row("a", "all, late", 97, 20, 1.0), row("b", "all, late", 75, 4, 0.3),
]  # fmt: skip


def test_tables_have_a_line_a_world_and_say_who_breaks() -> None:
    assert comparison.worlds_of(ROWS) == ["paper", "dark", "all, late"]
    ((sun, layer, lines),) = comparison.matrices(ROWS)
    assert (sun, layer) == ("random", "none")
    assert lines == [
        ["world", "a", "b"],
        ["paper", "98 / 0.50 / 0", "80 / 0.40 / 2"],
        ["dark", "60 / 0.60 / 0", "78 / 0.40 / 3"],
        ["all, late", "97 / 1.00 / 20", "75 / 0.30 / 4"],
    ]
    assert comparison.verdicts(ROWS) == [
        'a, Sun random, layer none: breaks in "dark", "all, late"; "all, late": +100 % delta-v',
        'b, Sun random, layer none: no break shown by 100 cases; "all, late": -25 % delta-v',
    ]
    assert all(" ".join(line) in " ".join(comparison.format_worlds(ROWS).split()) for line in lines)
    ahead = replace(ROWS[0], summary=ROWS[0].summary | {"ahead_delta_v_m_s": {"mean": 0.4}})
    assert comparison.matrices([ahead])[0][2][1] == ["paper", "98 / 0.50, 20.0 % of it by rules / 0"]


def test_a_rate_is_also_told_of_the_points_that_are_ever_lit() -> None:
    of_all, of_lit = ({"mean": value, "standard_deviation": 2.0} for value in (90.0, 97.5))
    words = {"inspection_rate_percent": of_all, "inspectable_rate_percent": of_lit}
    assert comparison.rate(replace(ROWS[0], summary=words)) == "90.00 ± 2.00, of lit 97.50"
    all_lit = words | {"inspectable_rate_percent": of_all}
    assert comparison.rate(replace(ROWS[0], summary=all_lit)) == "90.00 ± 2.00"


def test_a_world_changes_what_it_names_and_nothing_else() -> None:
    experiment = compose_experiment(["+experiment=robustness"]).experiment
    there = in_world(experiment, "all, one orbit")
    leo = compose_experiment(["+experiment=robustness", "world=leo"]).experiment
    assert there.mission == leo.mission
    assert there.sun.elevation_range_deg == leo.sun.elevation_range_deg  # compare.suns has the rest
    same = in_world(experiment, "paper")
    assert (same.mission, same.sun) == (experiment.mission, experiment.sun)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("{ligth: {shadow: conical}}", "compare.worlds.odd: there is no key ligth; did you mean light?"),
        ("{light: {shade: conical}}", "there is no key light.shade; did you mean light.shadow?"),
        ("{light: {shadow: round}}", "light.shadow is 'round'; it must be one of"),
    ],
)
def test_worlds_that_cannot_be(changes: str, message: str) -> None:
    words = ["+experiment=baselines", f"+compare.worlds={{odd: {changes}}}"]
    with pytest.raises(SettingError, match=message.replace("?", "[?]")):
        in_world(compose_experiment(words).experiment, "odd")
