"""The checker agrees with a proof, and refuses one in which anything is wrong or not modelled."""

import json
import os
import re
import shutil
from hashlib import sha256
from pathlib import Path
from typing import get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from fis_tools.model import operators
from pipeline.proof.verdict import COLUMNS
from tests.pipeline.proof.cases import job
from tests.pipeline.stages.cases import carried_out
from tests.programs import run_python

pytest.importorskip("flint", reason="the checker needs python-flint")
from pipeline.proof.check import check
from tests.pipeline.proof.forged import certificate


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
    theorem = json.loads(path.read_text(encoding="utf-8")) | changes
    path.write_text(json.dumps(theorem), encoding="utf-8")
    return theorem


def test_a_proof_is_checked(proved):
    theorem = restate(proved)
    text = check(proved)
    assert f"{theorem['num_periods']} periods of 1.0 s" in text
    assert theorem["controller_sha256"] in text


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
        ("num_periods", 30, "the step or axis"),
        ("num_periods", 0, "theorem.num_periods is 0"),
        ("num_periods", 10**8, "theorem.num_periods"),
        ("num_periods", 400_000, "fewer boxes"),
        ("num_periods", 100, "no box after 94 periods"),
        ("goal", [], "theorem.goal"),
        ("goal", ["1.5", 0.2], "theorem.goal"),
        ("goal", [float("nan"), 0.2], "NaN is no number"),
        ("start_low", "everywhere", "theorem.start_low"),
        ("start_low", [4.0, 4.0, 0.0, -0.03, -0.03, 0.0], "not below theorem.start_high"),
        ("limit", [1.0, -0.1, 0.0], "theorem.limit"),
        ("period_s", True, "theorem.period_s"),
        ("fault", "the time is over", "theorem.fault"),
        ("cells", [0, 240], "theorem.cells"),
        ("unheard_of", 1.0, "'unheard_of', which is not modelled"),
        ("controller_sha256", "0" * 64, "another controller"),
    ],
)
def test_another_theorem_is_refused(copy, key, value, fault):
    restate(copy, **{key: value})
    with pytest.raises(ValueError, match=fault):
        check(copy)


def change_controller(folder: Path, change) -> None:
    """Change a controller, and restate its hash."""
    path = folder / "controller.json"
    content = change(path.read_text(encoding="utf-8")).encode()
    path.write_bytes(content)
    restate(folder, controller_sha256=sha256(content).hexdigest())


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"hill"', '"body"', "attributes.force_axes"),
        ('"and_operator": "min"', '"and_operator": "product"', "and_operator is 'product'"),
        ('"or_operator": "max"', '"or_operator": "bounded_sum"', "or_operator is 'bounded_sum'"),
        ('"defuzzifier": "centroid"', '"defuzzifier": "lom"', "defuzzifier is 'lom'"),
        ('"peak": 0.96', '"peak": 0.95', "off its grid"),
        ('"range": [-4.0, 4.0]', '"range": [-4.1, 4.1]', "off its grid"),
        ('"negative_small", "negative_large"', '"zero", "negative_large"', "the residual of"),
        ('"negative_small", "negative_large"', '"zeros", "negative_large"', "no term of the output"),
        ('"velocity_radial"', '"velocity_along_track"', "inputs.1..name"),
        ('"name": "steady"', '"name": "steady", "name": "steady"', "stands twice"),
        (
            '"force_axes"',
            '"decision_period_s": "30.0", "force_axes"',
            "'decision_period_s', which is not modelled",
        ),
        ('"dead_band_force_x_n": "0.0"', '"dead_band_force_x_n": "nan"', "dead_band_force_x_n"),
    ],
)
def test_another_controller_is_refused(copy, old, new, fault):
    def exchange(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    change_controller(copy, exchange)
    with pytest.raises(ValueError, match=fault):
        check(copy)


#: what a system and its output may say besides, by the product's own names, and what a checker knows of each
METHODS = {"outputs": ("defuzzifier", "accumulation", "aggregation"), "systems": ("implication",)}


@pytest.mark.parametrize(("where", "key"), [(where, key) for where, keys in METHODS.items() for key in keys])
def test_every_other_method_is_refused(proved, copy, where, key):
    kinds = {"defuzzifier": "Defuzzifier", "implication": "AndOperator"}
    for method in get_args(getattr(operators, kinds.get(key, key.capitalize()))):
        shutil.copy(proved / "controller.json", copy)

        def add(text: str, method: str = method) -> str:
            content = json.loads(text)
            for system in content["systems"]:
                (system if where == "systems" else system["outputs"][0])[key] = method
            return json.dumps(content)

        change_controller(copy, add)
        with pytest.raises(ValueError, match=f"the key '{key}', which is not modelled"):
            check(copy)


def test_systems_are_known_by_the_force_that_they_drive(copy):
    def swap(text: str) -> str:
        content = json.loads(text)
        outputs = [system["outputs"][0] for system in content["systems"]]
        outputs[0]["name"], outputs[1]["name"] = outputs[1]["name"], outputs[0]["name"]
        return json.dumps(content)

    change_controller(copy, swap)
    with pytest.raises(ValueError, match="where 'position_along_track' is modelled"):
        check(copy)


def test_systems_may_stand_in_any_order(copy):
    def turn(text: str) -> str:
        content = json.loads(text)
        return json.dumps(content | {"systems": content["systems"][::-1]})

    change_controller(copy, turn)
    assert "checked" in check(copy)


def test_a_box_on_an_edge_of_a_cell_is_checked(tmp_path):
    certificate("start on a cell's edge", tmp_path)
    folder = tmp_path / "prove"
    assert "checked" in check(folder)
    columns = pq.read_table(folder / "tube.parquet").to_pydict()
    first = list(zip(columns["step"], columns["axis"], strict=True)).index((0.0, 0.0))
    for name in ("low_m", "high_m", "least_m_s", "greatest_m_s"):
        columns[name][first] = 0.0
    pq.write_table(pa.table(columns), folder / "tube.parquet")
    assert "each over 2 to" in check(folder)  # velocities are rounded to either side
    columns["constant_n"][first] -= 1.4
    pq.write_table(pa.table(columns), folder / "tube.parquet")
    with pytest.raises(ValueError, match="the residual of"):
        check(folder)


def test_no_flight_along_one_axis_of_the_plane_is_left_out(copy):
    # motion in the plane is coupled: whoever starts at rest on one axis leaves it
    restate(copy, start_low=[0.0, 4.0, 0.0, 0.0, 0.03, 0.0], start_high=[0.0, 4.5, 0.0, 0.0, 0.03, 0.0])
    columns = pq.read_table(copy / "tube.parquet").to_pydict()
    kept = [i for i, axis in enumerate(columns["axis"]) if axis == 1.0]
    along = {name: [column[i] for i in kept] for name, column in columns.items()}
    pq.write_table(pa.table(along), copy / "tube.parquet")
    with pytest.raises(ValueError, match="no box after 0 periods"):
        check(copy)


@pytest.mark.parametrize("name", ["theorem.json", "controller.json", "tube.parquet"])
def test_only_regular_files_are_read(copy, name):
    path = copy / name
    content = path.read_bytes()
    path.rename(copy / "elsewhere")
    path.symlink_to(copy / "elsewhere")
    with pytest.raises(OSError, match="a link to"):
        check(copy)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(OSError, match="a pipe, where a file is expected"):
        check(copy)
    path.unlink()
    path.write_bytes(content + bytes(65 * 1024**2))
    with pytest.raises(OSError, match="larger than"):
        check(copy)


def test_a_tube_of_many_equal_boxes_is_refused_unread(copy):
    columns = pq.read_table(copy / "tube.parquet").to_pydict()
    many = {name: np.full(3_000_000, column[0]) for name, column in columns.items()}
    pq.write_table(pa.table(many), copy / "tube.parquet", row_group_size=3_000_000)
    assert (copy / "tube.parquet").stat().st_size < 200_000
    with pytest.raises(ValueError, match="the tube has 3000000 boxes"):
        check(copy)


def test_nested_json_is_refused_in_a_sentence(copy):
    (copy / "theorem.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match=r"nested too deep|Expecting value"):
        check(copy)


def test_it_says_how_long_it_will_take(proved):
    lines = []
    check(proved, lines.append)
    (line,) = lines
    assert re.fullmatch(r"\d+ boxes to check: about \d+ s", line)


@pytest.mark.parametrize(("name", "damage"), [(None, b""), ("theorem.json", b"[]"), ("tube.parquet", b"PAR")])
def test_what_is_no_proof_is_refused_in_a_sentence(copy, name, damage):
    if name is None:
        shutil.rmtree(copy)
    else:
        (copy / name).write_bytes(damage)
    done = run_python("-m", "pipeline.proof.check", copy.parent, code=1)
    assert done.stdout == ""
    assert done.stderr.startswith("refused: ")
