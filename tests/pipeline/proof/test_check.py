"""The checker agrees with a proof, and refuses one in which a number is wrong."""

import json
import shutil
from hashlib import sha256
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipeline.proof.verdict import COLUMNS
from tests.pipeline.proof.cases import job
from tests.pipeline.stages.cases import carried_out
from tests.programs import run_python

pytest.importorskip("flint", reason="the checker needs python-flint")
from pipeline.proof.check import check


@pytest.fixture(scope="module")
def proved(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("proved")
    carried_out(job(), folder)
    return folder / "prove"


@pytest.fixture
def copy(proved, tmp_path) -> Path:
    return Path(shutil.copytree(proved, tmp_path / "prove"))


def restate(folder: Path, **changes) -> dict:
    """Change a theorem; return what it says."""
    path = folder / "theorem.json"
    told = json.loads(path.read_text(encoding="utf-8")) | changes
    path.write_text(json.dumps(told), encoding="utf-8")
    return told


def test_a_proof_is_checked(proved):
    told = restate(proved)
    text = check(proved)
    assert f"{told['num_periods']} periods of 1.0 s" in text
    assert told["controller_sha256"] in text


#: by how much each number of a tube is changed: enough that it is wrong, and little beside what it is
CHANGES = {
    "low_m": 1e-3,
    "high_m": -1e-3,
    "least_m_s": 1e-4,
    "greatest_m_s": -1e-4,
    "shear_per_s": 0.01,
    "constant_n": 0.02,
    "per_position_n_m": 0.2,
    "per_velocity_n_s_m": 2.0,
    "residual_n": -0.5,  # times the residual
    "step": 1.0,
    "axis": 1.0,
}


@pytest.mark.parametrize("column", COLUMNS)
def test_one_changed_number_is_refused(copy, column):
    columns = pq.read_table(copy / "tube.parquet").to_pydict()
    row = int(np.random.default_rng(len(column)).integers(0, len(columns["step"]) // 3))
    was = columns[column][row]
    wrong = was + CHANGES[column] * (was if column == "residual_n" else 1.0)
    columns[column][row] = 0.0 if column == "axis" and wrong > 1.0 else wrong
    pq.write_table(pa.table(columns), copy / "tube.parquet")
    with pytest.raises(ValueError, match=r"the tube|a velocity outside|the residual of"):
        check(copy)


@pytest.mark.parametrize(
    ("key", "value", "fault"),
    [
        ("goal", [1.4, 0.2], "the goal"),
        ("limit", [0.1, 0.0, 0.0], "the limit"),
        ("start_high", [3.6, 4.5, 0.0, 0.03, 0.03, 0.0], "a position outside"),
        ("start_low", [3.0, 4.0, 0.0, -0.03, -0.04, 0.0], "a velocity outside"),
        ("mass_kg", 11.9, "a position outside"),
        ("max_force_n", 0.2, "the residual of"),
        ("mean_motion_rad_s", 0.002, "a position outside"),
        ("period_s", 1.1, "a position outside"),
        ("num_periods", 30, "the place or size"),
        ("controller_sha256", "0" * 64, "another controller"),
    ],
)
def test_another_theorem_is_refused(copy, key, value, fault):
    restate(copy, **{key: value})
    with pytest.raises(ValueError, match=fault):
        check(copy)


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"hill"', '"body"', "attributes other"),
        ('"and_operator": "min"', '"and_operator": "product"', "another kind"),
        ('"peak": 0.96', '"peak": 0.95', "off its grid"),
        ('"range": [-4.0, 4.0]', '"range": [-4.1, 4.1]', "off its grid"),
        ('"negative_small", "negative_large"', '"zero", "negative_large"', "the residual of"),
        ('"velocity_radial"', '"velocity_along_track"', "other inputs"),
    ],
)
def test_another_controller_is_refused(copy, old, new, fault):
    text = (copy / "controller.json").read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1)
    (copy / "controller.json").write_text(text, encoding="utf-8")
    restate(copy, controller_sha256=sha256(text.encode()).hexdigest())
    with pytest.raises(ValueError, match=fault):
        check(copy)


@pytest.mark.parametrize(("name", "damage"), [(None, b""), ("theorem.json", b"[]"), ("tube.parquet", b"PAR")])
def test_what_is_no_proof_is_refused_in_a_sentence(copy, name, damage):
    if name is None:
        shutil.rmtree(copy)
    else:
        (copy / name).write_bytes(damage)
    done = run_python("-m", "pipeline.proof.check", copy.parent, code=1)
    assert done.stdout == ""
    assert done.stderr.startswith("refused: ")
