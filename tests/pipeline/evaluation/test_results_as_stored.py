"""Results of small evaluations, comparisons and evidence are as they were when somebody last looked."""

import pytest

from pipeline.run import artifacts
from tests import stored
from tests.pipeline.stored_runs import made

pytestmark = pytest.mark.slow
#: hashes, versions and what the machine is, and what stands elsewhere
LEFT_OUT = (
    "sha256",
    "versions",
    "processor",
    "git_revision",
    "sources",
    "config_hash",
    "settings",
    "text",
    "reason",
    "source",
    "seconds",
)
RESULTS = {
    "evaluation": (artifacts.SUMMARY, artifacts.EPISODES),
    "fleet": (artifacts.SUMMARY, artifacts.EPISODES, artifacts.DEPUTIES),
    "docking": (artifacts.SUMMARY, artifacts.EPISODES, artifacts.TRAJECTORIES),
    "assurance": (
        artifacts.EVIDENCE,
        artifacts.ASSURED_CASES,
        artifacts.SEARCHED,
        artifacts.DOMAIN,
        artifacts.PROOF_BOXES,
    ),
}


@pytest.mark.parametrize("name", RESULTS)
def test_results_are_as_they_were(name, tmp_path, file_regression):
    made(tmp_path, name)
    text = ""
    for file in RESULTS[name]:
        path = tmp_path / file
        content = stored.table(path) if path.suffix == ".parquet" else artifacts.read_json(tmp_path, file)
        text += f"== {file}\n{stored.text_of(content, LEFT_OUT)}"
    file_regression.check(text.replace(str(tmp_path), "RUN"), extension=".txt", basename=name)
