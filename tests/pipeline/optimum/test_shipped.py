"""The plans that ship fly: within all limits, with the points and the delta-v that their table says."""

import numpy as np
import pytest

from pipeline.flight.control.controller import open_loop
from pipeline.flight.fly.simulation import fly_all
from pipeline.flight.state.log import Scenario
from pipeline.optimum.bound import delta_v_bound
from pipeline.optimum.problem import problem_of
from pipeline.optimum.solved import HARDER_FOLDERS, SHIPPED_FOLDERS
from pipeline.run import artifacts, tables
from tests.pipeline.optimum.cases import composed

FOLDERS = [(folder, 95) for folder in SHIPPED_FOLDERS.values()]
FOLDERS += [
    (folder, points)
    for harder in HARDER_FOLDERS.values()
    for folder, points in zip(harder, (98, 99), strict=True)
]


@pytest.mark.parametrize(("folder", "asked"), FOLDERS, ids=lambda value: getattr(value, "name", value))
def test_every_plan_flies_as_its_table_says(folder, asked):
    mission = composed().experiment.mission
    assert mission.attitude.mode == "flown"
    cases = tables.read_parquet(folder, artifacts.OPTIMUM_CASES)
    fired = np.genfromtxt(folder / artifacts.OPTIMUM_FORCES, delimiter=",", skip_header=1)
    for row, case in enumerate(cases["case"].tolist()):
        forces = np.zeros((mission.num_controls, 3))
        own = fired[fired[:, 0] == case]
        forces[np.rint(own[:, 1] / mission.control_period_s).astype(int)] = own[:, 2:]
        position = np.array([cases[f"position_{axis}_m"][row] for axis in "xyz"])
        start = Scenario(position, np.zeros(3), float(cases["sun_angle_rad"][row]))
        outcome = fly_all(mission, open_loop("plan", forces), [start], workers=1)
        assert outcome.delta_v_m_s[0] == pytest.approx(cases["delta_v_m_s"][row], rel=1e-9)
        assert outcome.inspected_count[0] == cases["inspected_count"][row] >= asked
        assert not outcome.is_violated[0]
    assert cases["is_feasible"].all()
    assert len(cases["case"]) == 50


def test_bounds_in_the_table_are_those_of_the_cases():
    cases = tables.read_parquet(SHIPPED_FOLDERS["random"], artifacts.OPTIMUM_CASES)
    position = np.array([cases[f"position_{axis}_m"][3] for axis in "xyz"])
    start = Scenario(position, np.zeros(3), float(cases["sun_angle_rad"][3]))
    problem = problem_of(composed().experiment.mission, start)
    bound = delta_v_bound(problem, 95, float(cases["delta_v_m_s"][3]))
    assert bound == pytest.approx(cases["delta_v_bound_m_s"][3], rel=1e-9)
