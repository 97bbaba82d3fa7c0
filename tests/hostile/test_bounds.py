"""Small files that ask for much are refused before it is given."""

import io
import json
import os
import tracemalloc
import zipfile
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pytest
from onnx import helper, numpy_helper
from pyarrow import parquet

from fis_tools.__main__ import main
from fis_tools.analysis import arrays, tables
from fis_tools.analysis.condition import read_region
from fis_tools.errors import ControllerFileError, Mistake
from fis_tools.formats import serialize
from fis_tools.learning import table
from pipeline.controllers.policies import policy_of
from pipeline.evaluation.assurance.requirements import parse_requirements
from pipeline.flight.control.controller import ControllerError
from pipeline.flight.fly.stepping import NUM_SEEN
from pipeline.run import configuration
from pipeline.settings import mesh
from pipeline.settings.experiment import SettingError
from tests.fis_tools.sample_controllers import EXAMPLES, PAPER_LIKE
from tests.hostile.samples import network

MOST_BYTES = 400e6


@pytest.fixture
def little_memory():
    tracemalloc.start()
    yield
    assert tracemalloc.get_traced_memory()[1] < MOST_BYTES
    tracemalloc.stop()


def chain(kinds: list[tuple[str, list[str]]]):
    parts = zip(kinds, pairwise(["seen", *map(str, range(len(kinds) - 1)), "force"]), strict=True)
    return [helper.make_node(kind, [read, *more], [made]) for (kind, more), (read, made) in parts]


WIDE = [("MatMul", ["wide"]), ("Tanh", [])]


@pytest.mark.parametrize(
    "kinds",
    [
        [*WIDE, *[("Tanh", [])] * 1499],
        [*WIDE, *[("MatMul", ["square"])] * 9000],
        pytest.param([*WIDE, *[("Mul", ["gains"])] * 9000], marks=pytest.mark.slow),
        [("Tanh", [])] * 20_000,
    ],
    ids=["activations", "matrices", "factors", "operators"],
)
def test_a_network_is_counted_before_it_is_built(kinds, little_memory):
    shapes = {"wide": (NUM_SEEN, 1000), "square": (1000, 1000), "gains": 1000}
    rng = np.random.default_rng(1)
    content = network(chain(kinds), {name: rng.random(shape) for name, shape in shapes.items()})
    assert len(content) < 10e6
    with pytest.raises(ControllerError, match="cannot fly: it"):
        policy_of("p", content, "p.onnx")


def test_a_constant_that_gives_nothing_is_refused():
    node = helper.make_node("Constant", [], ["c"], value=numpy_helper.from_array(np.ones(3, np.float32), "c"))
    del node.output[:]
    with pytest.raises(ControllerError, match="cannot fly"):
        policy_of("p", network([node, *chain([("Tanh", [])])], {}), "p.onnx")


@pytest.mark.parametrize(
    "columns", [{"x": 0.0, "y": 0.0}, pytest.param({"x": "a" * 100, "y": 1.0}, marks=pytest.mark.slow)]
)
def test_a_table_that_unpacks_to_gigabytes(columns, tmp_path, little_memory):
    path = tmp_path / "x.parquet"
    part = pa.table({name: pa.repeat(value, 2**20) for name, value in columns.items()})
    with parquet.ParquetWriter(path, part.schema, compression="zstd") as writer:
        for _ in range(64):
            writer.write_table(part)
    assert path.stat().st_size < 2e6
    before = pa.total_allocated_bytes()
    with pytest.raises(ControllerFileError, match="has 67108864 rows of 2 columns; at most 10,000,000"):
        table.read(path)
    with pytest.raises(ControllerFileError, match="at most 10,000,000 cells"):
        tables.read(path, ["x"])
    assert pa.total_allocated_bytes() - before < MOST_BYTES


@pytest.mark.parametrize("form", [".csv", ".parquet"])
def test_a_long_word_in_a_table_is_refused_before_it_is_tried_as_a_number(form, tmp_path):
    path, word = tmp_path / f"x{form}", "x" * 1001
    if form == ".csv":
        path.write_text(f"x,y\n{word},1\n")
    else:
        parquet.write_table(pa.table({"x": pa.repeat(word, 1000), "y": np.arange(1000.0)}), path)
    with pytest.raises(Mistake, match="more than 1000 letters"):
        table.read(path)


def test_lists_and_groups_in_a_table_are_refused(tmp_path):
    parquet.write_table(pa.table({"x": [[1.0, 2.0]], "y": [{"a": 1}]}), tmp_path / "x.parquet")
    with pytest.raises(ControllerFileError, match="its column 'x' is of lists"):
        table.read(tmp_path / "x.parquet")


def zipped(content: bytes) -> bytes:
    sink = io.BytesIO()
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.obj", content)
    return sink.getvalue()


MIB = 1024**2
#: the greatest size that is read, and its reader
LARGEST = {
    **{f"x{ending}": (10 * MIB, serialize.load) for ending in serialize.ENDINGS},
    "x.json": (128 * MIB, serialize.load),
    "config.yaml": (2 * MIB, lambda path: configuration.read(path.parent)),
    "requirements.yaml": (2 * MIB, lambda path: parse_requirements(path.read_text(), "x")),
    "x.onnx": (16 * MIB, lambda path: policy_of("p", path.read_bytes(), "p.onnx")),
}


@pytest.mark.parametrize("name", LARGEST)
def test_a_file_larger_than_is_read(name, tmp_path):
    largest, read = LARGEST[name]
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(largest + 1)
    with pytest.raises((ValueError, OSError), match=f"larger|longer|{largest + 1} bytes"):
        read(tmp_path / name)


@pytest.mark.parametrize(
    ("read", "most"),
    [
        (lambda text: serialize.loads(text, "yaml"), 256 * 1024),
        (lambda text: serialize.loads(text, "fcl"), 2 * MIB),
        (lambda text: read_region(PAPER_LIKE.systems[0], text), 10_000),
    ],
    ids=["yaml", "fcl", "conditions"],
)
def test_a_text_longer_than_is_read(read, most):
    with pytest.raises(ValueError, match=r"longer than|characters"):
        read("a " * (most // 2) + "a")


@pytest.mark.parametrize("kind", ["json", "yaml"])
def test_what_is_nested_too_deep(kind):
    with pytest.raises(ControllerFileError, match="nested more than 64 deep"):
        serialize.loads("[" * 5000 + "]" * 5000, kind)


def test_systems_are_counted_before_they_are_read():
    content = json.loads(serialize.dump_json(PAPER_LIKE)) | {"systems": [0] * 51}
    with pytest.raises(ControllerFileError, match="has 51 entries; at most 50"):
        serialize.loads(json.dumps(content), "json")


#: more rules than are read, which are no rules, so that whoever looks at them says so
MANY_RULES = {
    "fis": lambda text: text + "\nx" * 50_001,
    "fll": lambda text: text.partition("# end of file")[0] + "\nrule: x" * 50_001,
    "fcl": lambda text: text.replace("END_RULEBLOCK", "RULE " * 50_001),
    "json": lambda text: text.replace('"rules": [', '"rules": [' + "0, " * 50_001),
    "yaml": lambda text: text.partition("rules:")[0] + f"rules: [{'0,' * 50_001}]\n...",
}


def tipper(kind: str) -> str:
    controller = serialize.load(EXAMPLES / "tipper.fis")
    dumped = {"json": serialize.dump_json, "yaml": serialize.dump_yaml}
    return dumped[kind](controller) if kind in dumped else serialize.writer(kind)(controller).text


KINDS = sorted({serialize.kind_of(f"x{ending}") for ending in serialize.ENDINGS})


@pytest.mark.parametrize("kind", KINDS)
def test_rules_are_counted_before_they_are_read(kind):
    with pytest.raises(ControllerFileError, match=r"(more than|at most) 50000"):
        serialize.loads(MANY_RULES[kind](tipper(kind)), kind)


@pytest.mark.parametrize("kind", KINDS)
def test_a_long_word_is_refused(kind):
    with pytest.raises(ControllerFileError, match=r"(more than|at most) 1000") as error:
        serialize.loads(tipper(kind).replace("poor", "p" * 1001), kind)
    assert len(str(error.value)) < 1000


CORNERS = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.zip", zipped(CORNERS * 10), "it is neither .stl nor .obj"),
        ("a.gltf", b"{}", "it is neither .stl nor .obj"),
        ("a.obj", zipped(CORNERS * 10), "0 triangles"),
        ("a.obj", CORNERS + b"f 1 2 3\n" * 20_001, "more than 20,000 triangles"),
        ("a.obj", CORNERS + b"".join(b"f" + b" 1 2 3" * k + b"\n" for k in range(1, 1500)), "more than 20"),
        ("a.obj", CORNERS + b"f" + b" 1" * 30_000, "more than 20,000 triangles"),
        ("a.obj", b"v 1 0\n" + CORNERS + b"f 1 2 3\n", "its line 1 has 2 coordinates; a vertex has three"),
        ("a.stl", bytes(80) + (40_000).to_bytes(4, "little") + bytes(50 * 40_000), "more than 20,000"),
        ("a.stl", b"solid x\n" + b"facet\nendfacet\n" * 20_001, "more than 20,000 triangles"),
        ("a.stl", bytes(80) + (2**31).to_bytes(4, "little") + bytes(100), "0 triangles|cannot be read"),
        ("b.obj", bytes(17 << 20), "larger than 16777216 bytes"),
    ],
)  # fmt: skip
def test_meshes_are_counted_before_they_are_loaded(name, content, message, tmp_path, little_memory):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SettingError, match=message):
        mesh.read_mesh(str(tmp_path / name))


def test_a_mesh_names_no_other_file(tmp_path):
    os.mkfifo(tmp_path / "secret.mtl")  # whoever opens it waits for ever
    faces = b"mtllib secret.mtl\nusemtl x\n" + CORNERS + b"v 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
    (tmp_path / "a.obj").write_bytes(faces)
    assert len(mesh.read_mesh(str(tmp_path / "a.obj"))) == 4


@pytest.mark.slow
def test_an_output_of_very_many_points_is_tried_at_fewer_places(tmp_path, capsys):
    content = json.loads(serialize.dump_json(replace(PAPER_LIKE, systems=PAPER_LIKE.systems[:1])))
    content["systems"][0]["outputs"][0]["points"] = 700_000
    path = tmp_path / "large.json"
    path.write_text(json.dumps(content))
    assert main(["diff", str(path), str(path)]) == 0
    assert "this may take minutes" in capsys.readouterr().err
    samples = arrays.spread_inputs(serialize.load(path).systems[0])
    assert len(samples) == 285
    np.testing.assert_array_equal(samples, arrays.spread_inputs(PAPER_LIKE.systems[0])[:285])


@pytest.mark.parametrize("ends", [(0.0, 5e-324), (0.0, 1e-300), (1e16, 1e16 + 2)])
def test_a_range_without_room_for_points_is_refused(ends):
    content = json.loads(serialize.dump_json(PAPER_LIKE))
    content["systems"][0]["inputs"][0]["range"] = ends
    with pytest.raises(ControllerFileError, match="too narrow for double precision"):
        serialize.loads(json.dumps(content), "json")
