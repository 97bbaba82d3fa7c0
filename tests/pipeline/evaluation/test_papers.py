"""Results of the paper stand beside those of its own mission and starts, and of no others."""

import pytest

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation.comparison import PAPER_NAME, describe_columns
from pipeline.evaluation.papers import is_papers_test, is_papers_training

#: of what the paper tells, by experiment and other words: its test and its training
COMPARABLE = {
    ("evaluate",): (True, True),
    ("reproduce",): (True, True),
    ("evaluate", "sun=random", "safety=filter", "monte_carlo.num_cases=20"): (True, True),
    ("evaluate", "flight=reference", "guidance=clusters", "coast_when_complete=false"): (True, True),
    ("train",): (True, False),
    ("train_paper",): (True, True),
    ("evaluate", "monte_carlo.max_distance_m=150"): (False, True),
    ("evaluate", "monte_carlo.parked=true"): (False, True),
    ("train_paper", "starts.min_distance_m=80", "starts.max_distance_m=80"): (True, False),
    ("evaluate", "world=leo"): (False, False),
    ("evaluate", "world=rso"): (False, False),
    ("evaluate", "navigation=fixes"): (False, False),
    ("evaluate", "deputy.max_distance_m=199"): (False, False),
    ("evaluate", "deputy.max_force_n=0.5"): (False, False),
    ("evaluate", "inspection_threshold_percent=90"): (False, False),
    ("evaluate", "duration_s=1800"): (False, False),
    ("evaluate", "+dispersions.deputy.mass_kg={kind:uniform,low:11,high:13}"): (False, False),
    ("evaluate_fleet",): (False, False),
    ("evaluate", "problem=docking"): (False, False),
}


@pytest.mark.parametrize("words", COMPARABLE, ids=" ".join)
def test_the_papers_results_are_of_its_own_mission_and_starts(words):
    name, *others = words
    experiment = compose_experiment([f"+experiment={name}", *others]).experiment
    assert (is_papers_test(experiment), is_papers_training(experiment)) == COMPARABLE[words]
    assert (PAPER_NAME in " ".join(describe_columns(experiment))) == COMPARABLE[words][0]
