"""Learned policies answer as ONNX's own reference does, to what the gym shows, and are flown and recorded."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import ModelProto, NodeProto, TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator
from onnx.reference.op_run import OpRun
from onnx.utils import Extractor
from scipy.special import erf

from pipeline.command_line.overrides import ConfigError, rewrite_paths
from pipeline.controllers.learned import Policy, Units, answer
from pipeline.controllers.policies import policy_of, read_policy
from pipeline.controllers.source import named
from pipeline.flight.control.controller import Controller, ControllerError
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.stepping import NUM_SEEN, OBSERVED
from pipeline.flight.state.log import FlightLog
from pipeline.gym import InspectionEnv, NormalizedObservation, task_of
from pipeline.gym.published import PublishedObservation
from pipeline.recording.recorder import FlightRecorder
from pipeline.recording.reflight import fly_again
from pipeline.scenarios import CLUSTERS, evaluation_scenarios

RNG = np.random.default_rng(4)
W1, B1 = RNG.normal(0.0, 0.3, (NUM_SEEN, 8)), RNG.normal(0.0, 0.3, 8)
W2, B2 = RNG.normal(0.0, 0.8, (8, 3)), RNG.normal(0.0, 0.1, 3)
SCALES = np.array([100.0] * 3 + [0.5] * 3 + [10.0] * 3 + [1.0] * 6 + [99.0] * 2 + [1.0, 3600.0])
CONSTANTS = {
    "w1": W1, "w1t": W1.T, "b1": B1, "w2": W2, "b2": B2, "scales": SCALES, "low": np.array(-1.0),
    "high": np.array(1.0), "force": np.array(0.03), "half": np.array([0.5]), "wide": np.ones((18, 3)),
    "w9": RNG.normal(0.0, 0.8, (8, 9)), "one": np.array(1.0), "root": np.array(np.sqrt(2.0)),
    "scale": np.arange(1.0, 9.0), "zero": np.array(0.0), "column": np.ones((3, 1)),
    "infinite": np.array(np.inf), "large": np.array(1e38), "two": np.array(2.0), "small": np.array(1e-3),
    "afrl11": RNG.normal(0.0, 0.05, (11, 8)), "afrl15": RNG.normal(0.0, 0.05, (15, 8)),
    "cubic": np.array(0.044715), "slope": np.array(np.sqrt(2.0 / np.pi)),
}  # fmt: skip
Step = tuple[str, Sequence[str], dict[str, Any]]
LAYERS: Sequence[Step] = (
    ("Flatten", [""], {"axis": 1}),
    ("Div", ["", "scales"], {}),
    ("Gemm", ["", "w1t", "b1"], {"transB": 1}),
    ("Tanh", [""], {}),
    ("Gemm", ["", "w2", "b2"], {"alpha": 0.5, "beta": 2.0}),
    ("Clip", ["", "low", "high"], {}),
    ("Mul", ["force", ""], {}),
)
OTHERWISE: Sequence[Step] = (
    ("Mul", ["", "half"], {}),
    ("Sub", ["", "half"], {}),
    ("MatMul", ["", "w1"], {}),
    ("Add", ["b1", ""], {}),
    ("Relu", [""], {}),
    ("MatMul", ["", "w2"], {}),
    ("Sub", ["b2", ""], {}),
    ("Clip", ["", "low"], {}),
    ("Identity", [""], {}),
)


#: what gates its numbers, or normalises them, as exporters write it, and as later versions of the format do
GATED: Sequence[Step] = (
    ("Div", ["", "scales"], {}),
    ("Gemm", ["", "w1t", "b1"], {"transB": 1}),
    ("Sigmoid", [""], {}),
    ("Mul", ["value2", ""], {}),
    ("LayerNormalization", ["", "scale", "b1"], {"axis": -1, "epsilon": 1e-4}),
    ("Div", ["", "root"], {}),
    ("Erf", [""], {}),
    ("Add", ["", "one"], {}),
    ("Mul", ["value5", ""], {}),
    ("Mul", ["", "half"], {}),
    ("Gelu", [""], {}),
    ("MatMul", ["", "w2"], {}),
)


#: layer normalisation, and GELU near which a hyperbolic tangent is, operator by operator
WRITTEN_OUT: Sequence[Step] = (
    ("Div", ["", "scales"], {}),
    ("Gemm", ["", "w1t", "b1"], {"transB": 1}),
    ("ReduceMean", [""], {"axes": [-1]}),
    ("Sub", ["value2", ""], {}),
    ("Pow", ["", "two"], {}),
    ("ReduceMean", [""], {"axes": [-1]}),
    ("Add", ["", "small"], {}),
    ("Sqrt", [""], {}),
    ("Div", ["value4", ""], {}),
    ("Mul", ["", "scale"], {}),
    ("Mul", ["value10", "value10"], {}),
    ("Mul", ["value10", ""], {}),
    ("Mul", ["cubic", ""], {}),
    ("Add", ["value10", ""], {}),
    ("Mul", ["slope", ""], {}),
    ("Tanh", [""], {}),
    ("Add", ["one", ""], {}),
    ("Mul", ["value10", ""], {}),
    ("Mul", ["half", ""], {}),
    ("MatMul", ["", "w2"], {}),
)


def changed(steps: Sequence[Step], index: int, *step: Any) -> list[Step]:
    """A chain with another operator at an index."""
    return [*steps[:index], (step[0], step[1], step[2]), *steps[index + 1 :]]


def model(
    steps: Sequence[Step], kind: int = TensorProto.FLOAT, width: int = 3, num_seen: int = NUM_SEEN
) -> ModelProto:
    """A chain of operators; the empty name stands for what the one before gives."""
    nodes: list[NodeProto] = []
    for index, (operator, inputs, attributes) in enumerate(steps):
        names = [name or f"value{index}" for name in inputs]
        nodes.append(helper.make_node(operator, names, [f"value{index + 1}"], **attributes))
    opset = 20 if {"Gelu", "LayerNormalization"} & {operator for operator, *_ in steps} else 13
    used = [name for _, inputs, _ in steps for name in inputs if name in CONSTANTS]
    numbers = np.float32 if kind == TensorProto.FLOAT else np.float64
    # the weights of a file are of single precision; what it means by such a root is read as the root
    exact = ("root", "slope", "cubic") if numbers is np.float64 else ()
    rounded = {
        name: CONSTANTS[name].astype(numbers if name in exact else np.float32).astype(numbers)
        for name in used
    }
    tensors = [numpy_helper.from_array(values, name) for name, values in rounded.items()]
    ends = [
        helper.make_tensor_value_info(name, kind, [None, width])
        for name, width in (("value0", num_seen), (f"value{len(steps)}", width))
    ]
    graph = helper.make_graph(nodes, "policy", ends[:1], ends[1:], tensors)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)


def read(made: ModelProto) -> Controller:
    return policy_of("policy", made.SerializeToString(), "policy.onnx")


class Erf(OpRun):
    """The format's reference rounds it to single precision, and the roots in the next."""

    def _run(self, values):
        return (erf(values),)


class Gelu(OpRun):
    def _run(self, values, approximate="none"):
        near = np.tanh(np.sqrt(2.0 / np.pi) * (values + 0.044715 * values**3))
        return (0.5 * values * (1.0 + (near if approximate == "tanh" else erf(values / np.sqrt(2.0)))),)


@pytest.mark.parametrize(
    "steps",
    [LAYERS, OTHERWISE, GATED, changed(GATED, 10, "Gelu", [""], {"approximate": "tanh"}), WRITTEN_OUT],
    ids=["layers", "otherwise", "gated", "gated near it", "written out"],
)
def test_a_network_answers_what_the_reference_of_the_format_does(steps) -> None:
    seen = RNG.normal(0.0, 1.0, (50, NUM_SEEN)) * SCALES
    outputs, pilot = np.empty((50, 3)), read(model(steps)).pilot
    assert isinstance(pilot, Policy)
    answer(pilot.network, seen, np.zeros((2, NUM_SEEN)), outputs)
    reference = ReferenceEvaluator(model(steps, TensorProto.DOUBLE), new_ops=[Erf, Gelu])
    (expected,) = reference.run(None, {"value0": seen})
    np.testing.assert_allclose(outputs, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ([*LAYERS, ("Exp", [""], {})], "it has the operator Exp; only a chain of Add, Sub, "),
        ([("Add", ["", ""], {}), *LAYERS], "its operator Add does not take the numbers of the one before"),
        ([*LAYERS[:-2], ("Clip", ["low", "", "high"], {})], "its operator Clip does not take numbers"),
        ([*LAYERS, ("Mul", ["", "infinite"], {})], "its constant infinite is not finite; export a"),
        ([*LAYERS, *[("Mul", ["", "large"], {})] * 9], "its constants multiply to infinity; export a policy"),
        ([*LAYERS, ("Div", ["", "zero"], {})], "its operator Div does not take numbers"),
        ([("MatMul", ["", "wide"], {})], r"weights of shape \(18, 3\) follow 19 numbers"),
        ([("Add", ["", "b1"], {}), *LAYERS], r"constants of shape \(8,\) follow 19 numbers"),
        ([*LAYERS, ("Add", ["", "column"], {})], r"constants of shape \(3, 1\) follow 3 numbers"),
        ([*LAYERS, ("Clip", [""], {"max": 0.1})], "its operator Clip has the attribute 'max'; use opset 13"),
        ([*LAYERS, ("Clip", ["", "column"], {})], "its operator Clip does not take numbers and constants"),
        ([("Flatten", [""], {"axis": 0}), *LAYERS], "its operator Flatten does not take numbers"),
        ([("Reshape", [""], {}), *LAYERS], "its operator Reshape does not take numbers and constants"),
        ([("Expand", [""], {}), *LAYERS], "its operator Expand does not take numbers and constants"),
        ([("Cast", [""], {"to": 7}), *LAYERS], "its operator Cast does not take numbers and constants"),
        ([("Where", [""], {}), *LAYERS], "its operator Where is no softplus with a threshold"),
        ([*GATED[:6], ("Tanh", [""], {}), *GATED[7:]], "its operator Mul does not take the numbers"),
        (changed(GATED, 10, "Gelu", [""], {"approximate": "cubic"}), "its operator Gelu does not take"),
        *(
            (changed(WRITTEN_OUT, *step), f"its operator {name} does not take the numbers of the one before")
            for name, step in (
                ("Div", (2, "ReduceMean", [""], {"axes": [0]})),
                ("Div", (3, "Sub", ["", "value2"], {})),
                ("Div", (4, "Pow", ["", "half"], {})),
                ("Div", (5, "ReduceMean", [""], {"axes": [-1], "keepdims": 0})),
                ("Div", (6, "Add", ["", "scale"], {})),
                ("Mul", (10, "Mul", ["value10", "value9"], {})),
                ("Mul", (12, "Mul", ["small", ""], {})),
                ("Mul", (14, "Mul", ["two", ""], {})),
                ("Mul", (16, "Add", ["two", ""], {})),
            )
        ),
        ([*GATED[:2], ("LayerNormalization", ["", "scale"], {"axis": 0}), GATED[-1]], "its operator Layer"),
        ([*GATED[:2], ("Erf", [""], {}), GATED[-1]], "it has the operator Erf; only a chain of"),
        (LAYERS[:4], "it answers with 8 numbers; a policy gives three forces"),
    ],
)
def test_what_is_no_chain_of_layers_is_refused_in_a_sentence(steps, reason) -> None:
    with pytest.raises(ControllerError, match=rf"policy.onnx cannot fly: {reason}"):
        read(model(steps))


EXPORTS = Path(__file__).parent / "exports"
#: the files, and the name of what each takes
INPUTS = {
    path: onnx.load(path, load_external_data=False).graph.input[0].name for path in EXPORTS.glob("*.onnx")
}


@pytest.mark.parametrize("path", sorted(EXPORTS.glob("*.onnx")), ids=lambda path: path.stem)
def test_what_learners_libraries_export_answers_as_the_reference_does(path: Path) -> None:
    """`exports/make_exports.py` wrote the files; of several outputs the first is that of actions."""
    seen = RNG.normal(0.0, 1.0, (1, NUM_SEEN))
    pilot = read_policy(path).pilot
    assert isinstance(pilot, Policy)
    outputs = np.empty((1, 3))
    answer(pilot.network, seen, np.zeros((2, max(pilot.network.widths))), outputs)
    expected, *_ = ReferenceEvaluator(onnx.load(path)).run(None, {INPUTS[path]: seen.astype(np.float32)})
    np.testing.assert_allclose(outputs, expected, rtol=1e-4, atol=1e-5)
    # the file that is kept, in recordings, holds all weights
    again = policy_of(path.stem, pilot.source, path.name).pilot
    np.testing.assert_array_equal(again.network.numbers, pilot.network.numbers)


LEVELS = sorted((EXPORTS / "levels").glob("*.onnx"))


@pytest.mark.parametrize("path", LEVELS, ids=lambda path: path.stem)
def test_levels_are_those_that_exports_of_them_choose(path: Path) -> None:
    seen = RNG.normal(0.0, 2.0, (100, NUM_SEEN)).astype(np.float32)
    made, pilot = onnx.load(path), read_policy(path).pilot
    outputs = np.empty((len(seen), 9))
    answer(pilot.network, seen.astype(float), np.zeros((2, NUM_SEEN)), outputs)
    chosen = outputs.reshape(-1, 3, 3).argmax(axis=2)
    name, levels = made.graph.input[0].name, made.graph.output[0].name
    reference = ReferenceEvaluator(Extractor(made).extract_model([name], [levels]))
    expected = [reference.run(None, {name: row[np.newaxis]})[0][0] for row in seen]
    np.testing.assert_array_equal(chosen, expected)
    assert set(chosen.ravel()) == {0, 1, 2}


def changed_choices(path: Path) -> Iterator[ModelProto]:
    """A model with one attribute of its choice changed at a time."""
    for index, node in enumerate(onnx.load(path).graph.node):
        if node.op_type in ("ArgMax", "Split", "Concat", "Softmax"):
            for number, attribute in enumerate(node.attribute):
                if attribute.name in ("axis", "keepdims", "select_last_index"):
                    made = onnx.load(path)
                    other = made.graph.node[index].attribute[number]
                    other.i = 0 if attribute.name == "axis" else 1 - attribute.i
                    yield made


@pytest.mark.parametrize("path", [path for path in LEVELS if path.stem != "sb3"], ids=lambda path: path.stem)
def test_another_choice_than_the_largest_of_each_axis_is_refused(path: Path) -> None:
    """That of Stable-Baselines3 has further outputs, which are not read."""
    models = list(changed_choices(path))
    assert len(models) >= 3
    for made in models:
        with pytest.raises(ControllerError, match="cannot fly: its operator"):
            read(made)
    made = onnx.load(path)
    del made.metadata_props[:]
    with pytest.raises(ControllerError, match="cannot fly: it has the operator"):
        read(made)


def test_a_choice_that_leads_in_a_circle_is_refused() -> None:
    for operator in ("Identity", "Reshape", "ArgMax", "Concat", "Softmax"):
        made = onnx.load(EXPORTS / "levels" / "shaped.onnx")
        for node in made.graph.node:
            if node.op_type in ("ArgMax", "Reshape"):
                node.op_type, node.input[0] = operator, node.output[0]
                del node.attribute[:]
        with pytest.raises(ControllerError, match="cannot fly"):
            read(made)


def test_weights_beside_a_file_are_read_from_the_file_of_its_name_alone(tmp_path: Path) -> None:
    exported = EXPORTS / "rsl_rl_dynamo.onnx"
    path, data = tmp_path / "policy.onnx", tmp_path / "policy.onnx.data"
    renamed = onnx.load(exported, load_external_data=False)
    for tensor in renamed.graph.initializer:
        for entry in tensor.external_data:
            entry.value = data.name if entry.key == "location" else entry.value
    path.write_bytes(renamed.SerializeToString())
    with pytest.raises(
        ControllerError, match=r"another file, which is not policy\.onnx\.data beside it; save"
    ):
        read_policy(path)
    content = exported.with_name(f"{exported.name}.data").read_bytes()
    data.write_bytes(content[:-4])
    with pytest.raises(ControllerError, match=r"policy\.onnx\.data does not hold its weights"):
        read_policy(path)
    data.write_bytes(content)
    np.testing.assert_array_equal(
        read_policy(path).pilot.network.numbers, read_policy(exported).pilot.network.numbers
    )
    path.write_bytes(exported.read_bytes())  # which names another file
    with pytest.raises(ControllerError, match="its weights are in another file"):
        read_policy(path)


def test_an_output_is_chosen_by_its_name() -> None:
    """A second head of the same width, and what makes it clear which is that of the forces."""
    made = model([*LAYERS, ("Mul", ["half", ""], {})])
    first, second = f"value{len(LAYERS)}", f"value{len(LAYERS) + 1}"
    made.graph.output.insert(0, helper.make_tensor_value_info(first, TensorProto.FLOAT, [None, 3]))
    with pytest.raises(ControllerError, match="it has 2 outputs, and none is clearly the one with the"):
        read(made)
    chosen = {}
    for name in (first, second):
        helper.set_model_props(made, {"output": name})
        chosen[name] = read(made).pilot.network
    seen, outputs = np.ones((1, NUM_SEEN)), {name: np.empty((1, 3)) for name in chosen}
    for name, network in chosen.items():
        answer(network, seen, np.zeros((2, NUM_SEEN)), outputs[name])
    np.testing.assert_allclose(0.5 * outputs[first], outputs[second])
    helper.set_model_props(made, {"output": "value_of_state"})
    with pytest.raises(
        ControllerError, match="its metadata output is 'value_of_state', which is none of its"
    ):
        read(made)
    del made.metadata_props[:]
    made.graph.output[0].name = made.graph.node[len(LAYERS) - 1].output[0] = "actions"
    made.graph.node[len(LAYERS)].input[1] = "actions"
    np.testing.assert_array_equal(read(made).pilot.network.numbers, chosen[first].numbers)


def test_metadata_tell_the_units() -> None:
    made = model(LAYERS)
    assert read(made).pilot.units == Units(forces_are_shares=False, observations_are_normalized=False)
    helper.set_model_props(made, {"forces": "shares", "observations": "normalized", "author": "anyone"})
    assert read(made).pilot.units == Units(forces_are_shares=True, observations_are_normalized=True)
    helper.set_model_props(made, {"forces": "pounds"})
    with pytest.raises(
        ControllerError, match="its metadata forces is 'pounds'; it must be newtons or shares or levels"
    ):
        read(made)
    for metadata, words in (
        ({"forces": "levels"}, "forces is levels, and levels_n is missing"),
        ({"levels_n": "0.1"}, "forces is newtons, and levels_n is 0.1"),
        ({"forces": "levels", "levels_n": "-1"}, "levels_n is '-1'; it must be a number above 0"),
        ({"decision_period_s": "soon"}, "decision_period_s is 'soon'; it must be a number above 0"),
        ({"forces": "levels", "levels_n": "0.1"}, "answers with 3 numbers; a policy gives three numbers for"),
    ):
        wrong = model(LAYERS)
        helper.set_model_props(wrong, metadata)
        with pytest.raises(ControllerError, match=words):
            read(wrong)


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "policy.onnx"
    outside = model(LAYERS)
    bare = model(LAYERS)
    outside.graph.initializer[0].data_location = TensorProto.EXTERNAL
    del bare.graph.initializer[:]
    with pytest.raises(ControllerError, match=r"cannot be read .*; give an ONNX file"):
        read_policy(path)
    for content, message in (
        (b"\xff" * 100, "it is no ONNX file; give one"),
        (bytes(1 << 25), "larger than 16777216 bytes"),
        (outside.SerializeToString(), "its weights are in another file"),
        (bare.SerializeToString(), "its operator Mul does not take the numbers of the one before"),
    ):
        path.write_bytes(content)
        with pytest.raises(ControllerError, match=message):
            read_policy(path)


@pytest.mark.slow
def test_shares_of_the_greatest_force_fly_as_the_gym_flies_them(tmp_path: Path) -> None:
    """What was learned in `NormalizedObservation`, with the gym's actions, and nothing built around it."""
    made = onnx.load(EXPORTS / "sb3_ppo.onnx")
    helper.set_model_props(made, {"forces": "shares", "observations": "normalized"})
    onnx.save(made, tmp_path / "learned.onnx")
    task = task_of(OVERRIDES)
    controller = named(str(tmp_path / "learned.onnx"), task.mission)
    start = evaluation_scenarios(task.experiment)[0]
    log = fly_logged(task.mission, controller, start)
    env, reference = NormalizedObservation(InspectionEnv(OVERRIDES)), ReferenceEvaluator(made)
    seen, _ = env.reset(options={"scenario": start})
    for k in range(20):
        action, *_ = reference.run(None, {"input": seen[np.newaxis]})
        force = np.clip(action[0], -1.0, 1.0) * task.mission.deputy.max_force_n
        np.testing.assert_allclose(log.force_asked_n[k], force, atol=1e-5)
        seen, *_ = env.step(np.clip(action[0], -1.0, 1.0))


@pytest.mark.slow
@pytest.mark.parametrize("world", ["afrl", "afrl_weighted"])
def test_what_learned_from_afrls_observations_flies_as_in_the_gym(world: str) -> None:
    num_seen = {"afrl": 11, "afrl_weighted": 15}[world]
    steps: Sequence[Step] = (
        ("MatMul", ["", f"afrl{num_seen}"], {}),
        ("Tanh", [""], {}),
        ("MatMul", ["", "w2"], {}),
        ("Mul", ["small", ""], {}),
    )
    made = model(steps, num_seen=num_seen)
    helper.set_model_props(made, {"forces": "shares", "observations": "published"})
    task = task_of([f"world={world}", "duration_s=900"])
    start, controller = evaluation_scenarios(task.experiment)[0], read(made)
    log = fly_logged(task.mission, controller, start)
    inner = InspectionEnv([f"world={world}", "duration_s=900"])
    env = PublishedObservation(inner, start.generator(CLUSTERS))
    reference = ReferenceEvaluator(model(steps, TensorProto.DOUBLE, num_seen=num_seen))
    seen, _ = env.reset(options={"scenario": start})
    for k in range(task.mission.num_controls):
        (action,) = reference.run(None, {"value0": seen[np.newaxis]})
        np.testing.assert_allclose(log.force_asked_n[k], action[0] * 1.0, rtol=0.0, atol=1e-8)
        seen, *_, info = env.step(action[0])
    assert info["num_inspected"] == log.is_inspected[-1].sum() > 0
    assert np.abs(log.force_asked_n).max() > 1e-4
    other = {"afrl": "afrl_weighted", "afrl_weighted": "afrl"}[world]
    with pytest.raises(ControllerError, match=f"the policy takes {num_seen} of AFRL's numbers; in"):
        fly_logged(task_of([f"world={other}", "duration_s=900"]).mission, controller, start)
    with pytest.raises(ControllerError, match="AFRL's agents observe no Sun out of the orbit plane"):
        fly_logged(task.mission, controller, replace(start, sun_elevation_rad=0.1))


def test_what_takes_other_numbers_than_afrls_is_refused() -> None:
    made = model(LAYERS)
    helper.set_model_props(made, {"observations": "published"})
    with pytest.raises(ControllerError, match="its input has the declared width 19; of AFRL's observations"):
        read(made)
    with pytest.raises(ControllerError, match=r"weights of shape \(11, 8\) follow 19 numbers"):
        read(model((("MatMul", ["", "afrl11"], {}), ("MatMul", ["", "w2"], {})), num_seen=11))


def test_a_path_stands_for_a_policy() -> None:
    assert rewrite_paths(["controller=my/a.onnx"]) == ["controller=policy", "controller.path='my/a.onnx'"]
    with pytest.raises(ConfigError, match="mixes names and paths, or kinds of files"):
        rewrite_paths(["controller=a.onnx,b.json"])


#: as in the tests of the gym, which compile the same flights
OVERRIDES = ["safety=filter", "duration_s=900", "sun=random"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> tuple[Any, Controller, list[Any], FlightLog]:
    """A policy's flight from the second start."""
    path = tmp_path_factory.mktemp("policy") / "learned.onnx"
    path.write_bytes(model(LAYERS).SerializeToString())
    task = task_of([*OVERRIDES, "monte_carlo.num_cases=7"])
    controller = named(str(path), task.mission)
    starts = evaluation_scenarios(task.experiment)
    return task, controller, starts, fly_logged(task.mission, controller, starts[1])


@pytest.mark.slow
def test_a_policy_flies_in_the_gym_what_it_flies_here(flown) -> None:
    task, controller, starts, log = flown
    assert controller.name == "learned"
    env, reference = InspectionEnv(OVERRIDES), ReferenceEvaluator(model(LAYERS))
    seen, _ = env.reset(options={"scenario": starts[1]})
    assert len(OBSERVED) == len(seen)
    most = task.mission.deputy.max_force_n
    for k in range(task.mission.num_controls):
        (force,) = reference.run(None, {"value0": seen[np.newaxis]})
        np.testing.assert_allclose(log.force_asked_n[k], force[0], atol=1e-6)
        seen, *_, info = env.step(force[0] / most)
    np.testing.assert_allclose(seen[:3], log.position_m[-1], atol=1e-2)
    assert info["num_inspected"] == log.is_inspected[-1].sum()
    assert info["delta_v_m_s"] == pytest.approx(log.delta_v_m_s[-1], rel=1e-4)


@pytest.mark.slow
def test_levels_are_chosen_once_a_minute_as_in_the_gym() -> None:
    made = model([*LAYERS[:4], ("MatMul", ["", "w9"], {})], width=9)
    helper.set_model_props(made, {"forces": "levels", "levels_n": "0.05", "decision_period_s": "60"})
    task = task_of(OVERRIDES)
    start = evaluation_scenarios(task.experiment)[0]
    controller = read(made)
    log = fly_logged(task.mission, controller, start)
    env = InspectionEnv(OVERRIDES, levels_n=0.05, decision_period_s=60.0)
    reference, ends = ReferenceEvaluator(made), [False]
    seen, _ = env.reset(options={"scenario": start})
    for decision in range(15):
        (values,) = reference.run(None, {"value0": seen[np.newaxis]})
        levels = values.reshape(3, 3).argmax(axis=1)
        np.testing.assert_allclose(log.force_asked_n[6 * decision], 0.05 * (levels - 1.0), atol=1e-12)
        assert not log.force_asked_n[6 * decision + 1 : 6 * decision + 6].any()
        assert not any(ends)
        seen, _, *ends, info = env.step(levels)
    assert ends == [False, True]
    np.testing.assert_allclose(seen[:3], log.position_m[-1], atol=1e-2)
    assert info["delta_v_m_s"] == pytest.approx(log.delta_v_m_s[-1], rel=1e-6)
    assert log.force_asked_n.any()
    with pytest.raises(ControllerError, match="decision_period_s is 60; it must be a multiple"):
        fly_logged(task_of([*OVERRIDES, "control_period_s=9"]).mission, controller, start)


@pytest.mark.slow
def test_a_flight_is_the_same_in_any_company(flown, monkeypatch) -> None:
    task, controller, starts, log = flown
    monkeypatch.setattr("pipeline.controllers.learned.BLOCK", 3)
    many = fly_all(task.mission, controller, starts, 2)
    alone = fly_all(task.mission, controller, starts[1:2], 1)
    assert many.delta_v_m_s[1] == alone.delta_v_m_s[0] == log.delta_v_m_s[-1]
    assert many.mean_distance_m[1] == alone.mean_distance_m[0]
    assert len(set(many.delta_v_m_s)) == 7


@pytest.mark.slow
def test_its_recording_flies_again_without_the_file(flown, tmp_path: Path) -> None:
    task, controller, starts, log = flown
    recorder = FlightRecorder(task.experiment, controller, task.config)
    recorder.record(tmp_path / "flight.mcap", starts[1], log, "case-1")
    assert fly_again(tmp_path / "flight.mcap").is_equal
