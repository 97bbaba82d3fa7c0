"""Tables of forces, and controllers by any of their ways into a run."""

import logging
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import linear_law
from fis_tools.analysis.measures import measure
from fis_tools.compiled.decorator import plain, plainly
from fis_tools.findings.audit import audit
from fis_tools.formats import serialize
from fis_tools.genes.stretches import rounded
from fis_tools.model import FuzzyController
from pipeline.command_line.arguments import ConfigError
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.played import read_played
from pipeline.controllers.source import load, named
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.control.law import decision_stride
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.schema import experiment_from
from tests import night
from tests.pipeline.command_line.cases import plain_config
from tests.places import PROJECT

HEADER = "time_s,force_x_n,force_y_n,force_z_n\n"
MISSION = experiment_from(plain_config()).mission


def test_constants_on_the_command_line_take_the_place_of_a_file_s():
    path = str(PROJECT / "conf/controller/champion_27.yaml")
    words = ["+experiment=evaluate", "controller=file", f"controller.path={path}"]
    with pytest.raises(ConfigError, match=r"by \+controller.attributes.NAME=\.\.\.$"):
        compose_experiment([*words, "controller.attributes.decision_period_s=60"])
    composed = compose_experiment([*words, "+controller.attributes.decision_period_s=60"]).experiment
    by_name = ["+experiment=evaluate", "controller=champion_27", "controller.attributes.decision_period_s=60"]
    for experiment in (composed, compose_experiment(by_name).experiment):
        assert decision_stride(load(experiment.controller, MISSION), MISSION) == 6


def test_a_table_of_forces(tmp_path, caplog):
    path = tmp_path / "plan.csv"
    path.write_text(HEADER + "0,0.1,-0.2,0.3\n10,0,1.5,-2\n20.0,0,0,0\n", encoding="utf-8-sig")
    with caplog.at_level(logging.WARNING, logger="pipeline"):
        controller = load({"kind": "open_loop", "path": str(path)}, MISSION)
    np.testing.assert_array_equal(controller.plan, [[0.1, -0.2, 0.3], [0, 1.5, -2], [0, 0, 0]])
    assert controller.name == "plan"
    assert "2 components beyond 1 N are clipped" in caplog.text
    path.write_text(HEADER)
    assert read_played(path, MISSION).plan.shape == (0, 3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "does not begin with the header time_s,force_x_n"),
        (b"\xff\xfe\x00", "cannot be read"),
        ("t,x,y,z\n0,0,0,0\n", "does not begin with the header"),
        (HEADER + "0,0,0,0\n20,0,0,0\n", "data row 2 has time_s 20, expected 10; give one row for each"),
        (HEADER + "5,0,0,0\n", "data row 1 has time_s 5, expected 0"),
        (HEADER + "0,0,0\n", "line 2 is '0,0,0'; write 4 finite numbers"),
        (HEADER + "0,0,zero,0\n", "line 2 is '0,0,zero,0'; write 4 finite numbers"),
        (HEADER + "0,0,nan,0\n", "write 4 finite numbers"),
        (HEADER + "".join(f"{10 * k},0,0,0\n" for k in range(361)), "has 361 rows, the flight 360 control"),
    ],
)
def test_tables_that_cannot_be_flown(content, message, tmp_path):
    path = tmp_path / "plan.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ControllerError, match=message):
        read_played(path, MISSION)


def test_first_push_is_the_limited_sum_of_the_signals_beyond_the_dead_band(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By day as plain Python, to the same bits: compiling takes twenty seconds, for two periods' flights."""
    if not night.IS_WHOLE:
        monkeypatch.setattr(linear_law, "fly_linearly", plain(linear_law.fly_linearly))
    words = ["+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=8"]
    experiment = compose_experiment(words).experiment
    mission = replace(experiment.mission, duration_s=experiment.mission.control_period_s)
    starts = evaluation_scenarios(experiment)
    champion = named("champion_27", mission)
    genes = np.array([0.6, 0.4, 0.1, 0.7, 0.55, 0.5, 0.8, 0.3, 0.9])
    controller = linear_law.LinearLaw(champion).decode(genes)
    with linear_law.flying(), nullcontext() if night.IS_WHOLE else plainly("pipeline"):
        flown = fly_all(mission, controller, starts)
    slopes = controller.numbers.values[0, linear_law.place_of(controller)].reshape(3, linear_law.NUMBERS)
    bands = [float(dict(champion.fuzzy.attributes)[f"dead_band_force_{axis}_n"]) for axis in "xyz"]
    expected = []
    for start in starts:
        signals = fly_logged(mission, champion, start).fis_input[0]
        force = np.clip((slopes[:, :3] * signals).sum(axis=1), -slopes[:, 4], slopes[:, 4])
        force[np.abs(force) < bands] = 0.0
        expected.append(np.abs(force).sum() * mission.control_period_s / mission.deputy.mass_kg)
    assert min(expected) > 0.0
    np.testing.assert_allclose(flown.delta_v_m_s, expected, rtol=1e-9)


def shipped(name: str) -> FuzzyController:
    return serialize.load(PROJECT / "conf" / "controller" / f"{name}.yaml")


AFRL = ("champion_afrl", "champion_afrl_weighted", "champion_afrl_six_dof", "champion_rso")
RULES = dict.fromkeys(("champion_27", "champion_27_fixed_sun", *AFRL), 27)
RULES |= {"champion_81": 81, "champion_leo": 15}


@pytest.mark.parametrize(("name", "num_rules"), RULES.items())
def test_their_audit_finds_nothing(name: str, num_rules: int) -> None:
    controller = shipped(name)
    assert sum(len(system.rules) for system in controller.systems) == num_rules
    assert audit(controller).findings == ()
    for system in controller.systems:
        assert measure(system).rule_consistency.index >= 0.8
        assert measure(system).completeness.least >= 0.49  # a half, but between two points of the universe
        for variable in (*system.inputs, *system.outputs):
            assert variable.maximum == rounded(variable.maximum, 2)
    for name_of_constant, value in controller.attributes:
        if name_of_constant != "force_axes":
            assert float(value) == rounded(float(value), 2)


def test_the_rehearsing_champion_is_champion_27_but_for_its_rehearsal() -> None:
    plain, rehearsing = shipped("champion_27"), shipped("champion_27_one_push")
    attributes = tuple(sorted((*plain.attributes, ("rehearsal_reach_m_s", "0.15"))))
    renamed = replace(rehearsing, name=plain.name, provenance=plain.provenance)
    assert renamed == replace(plain, attributes=attributes)
