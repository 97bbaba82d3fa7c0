"""The stage search: what it leaves behind, and that a champion that was trained is the best trial's."""

import csv
import json
from dataclasses import replace

import pytest

from fis_tools.formats import serialize
from pipeline.command_line.config import compose_experiment
from pipeline.run import artifacts
from pipeline.settings.experiment import SettingError
from pipeline.stages import search
from tests.pipeline.stages.cases import prepared


@pytest.mark.slow
def test_the_best_trial_is_told_and_its_champion_kept(tmp_path):
    run = prepared(
        tmp_path,
        "stages=[search]",
        "++hparams_search={trials: 3, trains: true, num_cases: 8, block_cases: 4}",
        "+hparams_search.space.optimizer.initial_step={low: 0.01, high: 0.5, log: true}",
        "optimizer.mutation=local",
    )  # fmt: skip
    search.run(run.experiment, tmp_path)
    with (tmp_path / artifacts.SEARCH_TRIALS).open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["trial"] for row in rows] == ["0", "1", "2"]
    complete = {float(row["cost_m_s"]): row for row in rows if row["state"] == "complete"}
    best = json.loads((tmp_path / artifacts.SEARCH_BEST).read_text())
    assert best["cost_m_s"] == min(complete)
    step = complete[min(complete)]["optimizer.initial_step"]
    assert best["words"] == [f"optimizer.initial_step={step}"]
    champion = serialize.load(tmp_path / artifacts.CHAMPION)
    # going on has nothing left to try, and comes to the same
    search.run(replace(run.experiment, resume=True), tmp_path)
    assert json.loads((tmp_path / artifacts.SEARCH_BEST).read_text()) == best
    assert serialize.load(tmp_path / artifacts.CHAMPION) == champion


def test_a_search_over_nothing_is_refused():
    with pytest.raises(SettingError, match=r"stages has search, and hparams_search.space is empty"):
        compose_experiment(["+experiment=evaluate", "controller=coast", "stages=[search]"])
