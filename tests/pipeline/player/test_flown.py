"""What a page flies is what the product flies, bit for bit; what no module flies is refused."""

import json
from functools import cache

import numpy as np
import pytest
from numba import types

from benchmarks.scaling import words_of
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.player import flown
from pipeline.player.arguments import MODULES, PLAIN
from pipeline.player.build import FOLDER, functions
from pipeline.player.flown import FlownCases, flown_in_page
from pipeline.player.memory import Memory, leaves_of, types_of
from pipeline.player.runs import PlayedRun
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.places import conf_folder
from tests import night
from tests.pipeline.player.pages import ELEVATED, FLOWN, LOG, NUM_CASES, TURNING, decoded, run_of
from tests.pipeline.player.statements import assert_told
from tests.places import PROJECT

pytestmark = pytest.mark.slow

EXPORTS = PROJECT / "tests" / "pipeline" / "controllers" / "exports"
#: what shipped controllers do not ask of the modules: policies, errors, clusters, turning chiefs
OTHERS = (
    ("champion_27", "navigation=fixes", "actuators=real"),
    ("champion_27_rehearsed", "navigation=fixes"),
    ("champion_27", "navigation=range_bearing", "actuators=real", "safety=robust"),
    ("champion_27", "guidance=clusters"),
    ("champion_27", "attitude=flown"),
    ("champion_27", "dynamics=two_body", "sun=random"),
    ("policy", f"controller.path={EXPORTS / 'sb3_ppo.onnx'}", "world=afrl"),
    ("champion_27", "navigation=fixes", "sun=random", ELEVATED),
    ("champion_27", "guidance=clusters", "actuators=real", "sun=random", ELEVATED),
    ("champion_27", "chief.initial_angular_velocity_rad_s=[0,0,0.002]", "sun=random"),
)
#: an ellipse, and a transfer orbit's
ELLIPSE = "orbit=elements", "orbit.semi_major_axis_m=9615714", "orbit.eccentricity=0.3"
STEEP = "orbit=elements", "orbit.semi_major_axis_m=24478137", "orbit.eccentricity=0.725"
#: a true course of the chief, along which all that deputies predict goes, and a Sun that moves
COURSES = (
    ("champion_27", "dynamics=two_body", *ELLIPSE, "sun=random", ELEVATED),
    ("champion_leo", "dynamics=low_orbit", *ELLIPSE, "navigation=fixes", "actuators=real", "sun=random"),
    ("champion_27", "dynamics=two_body", *STEEP, TURNING, "safety=filter", "sun=random"),
    ("champion_leo_rehearsed", "dynamics=two_body", *STEEP, "light=shadow", "sun=random", "duration_s=1800"),
    ("champion_27", "dynamics=low_orbit", "orbit.course=true", "orbit.epoch=2026-11-26T12:00:00", TURNING),
)


def shipped(group):
    return sorted(path.stem for path in (conf_folder() / group).glob("*.yaml"))


@cache
def compared_in_docking_alone():
    docking, inspecting = (
        compose_experiment([f"+experiment={name}"]).experiment.compare.controllers
        for name in ("compare_docking", "baselines")
    )
    return set(docking) - set(inspecting)


def docks(name):
    """Return whether a controller is for docking: it is compared in that alone, or flies no inspection."""
    if name in compared_in_docking_alone():
        return True
    try:
        source.named(name, Mission())
    except SettingError:
        return True
    return False


def worlds():
    """Each controller in its world, and in all other worlds and problems one of the paper's world."""
    names = [name for name in shipped("controller") if name not in source.WITH_PATHS]
    flown = [(name, *(["problem=docking"] if docks(name) else words_of(name)[1:])) for name in names]
    chosen = {word for words in flown for word in words}
    others = [f"{group}={name}" for group in ("world", "problem") for name in shipped(group)]
    return [*flown, *(("champion_27", word) for word in others if word not in chosen)]


@pytest.mark.parametrize("words", FLOWN, ids="-".join)
def test_a_page_flies_fresh_cases_to_the_products_bits(ready, words):
    assert_flown(ready(*words), run_of(*words)[3], range(NUM_CASES))


#: all by night, also those that look far ahead
MISSIONS = night.by_day([*worlds(), *OTHERS, *COURSES], 9)


@pytest.mark.parametrize("words", MISSIONS, ids=lambda words: "-".join(words).replace(f"{PROJECT}/", ""))
def test_every_mission_of_the_shipped_worlds_flies_in_a_page(ready, monkeypatch, words):
    # pages carry fewer of the cases that have much of their own
    monkeypatch.setattr(flown, "MOST_AHEAD", NUM_CASES)
    monkeypatch.setattr(flown, "MOST_BYTES", 10_000_000)
    mission, controller, starts, logs = run_of(*words)
    chosen = flown_in_page(PlayedRun("", "", mission, controller, starts))
    assert isinstance(chosen, FlownCases), chosen
    page = ready(*words)
    assert_flown(page, logs, chosen.rows or range(len(logs)))
    if any(log.force_hill_n.any() for log in logs[3:4]):
        assert_told(page, mission, controller, starts, logs, 3)


def assert_flown(page, logs, rows):
    """Fail unless a page flies cases to the last bit of what the product logs."""
    assert len(rows) == len(logs)
    for row in rows:
        log, again = logs[row], page.evaluate(LOG, row)
        assert decoded(again["position"], "<f8").tobytes() == log.position_m.tobytes(), row
        assert decoded(again["spent"], "<f8").tobytes() == log.delta_v_m_s.tobytes(), row
        assert np.array_equal(
            decoded(again["isSeen"], "u1").reshape(log.is_inspected.shape), log.is_inspected
        )
        assert decoded(again["inputs"], "<f8").tobytes() == log.fis_input.tobytes(), row


@pytest.mark.parametrize("words", [("champion_27",), ("champion_afrl", "world=afrl")], ids="-".join)
def test_a_module_refuses_a_snapshot_of_other_types(ready, words):
    page = ready(*words)
    message = page.evaluate(
        """async () => {
            const { snapshot } = player.page.runs[0], other = structuredClone(snapshot);
            other.functions.fly.types += 1;
            const ask = beginWorker(player.page.worker);
            const module = player.page.modules[player.page.runs[0].module];
            return ask({ module, snapshot: other }).then(() => "", error => error.message);
        }"""
    )
    assert "is of other types than its snapshot" in message


@pytest.mark.parametrize("name", MODULES)
def test_the_modules_are_of_the_types_that_the_product_has(name):
    types = {function: types_of(arguments.leaves(Memory())) for function, _, arguments in functions(name)}
    assert json.loads((FOLDER / "types.json").read_text(encoding="utf-8"))[name] == types
    assert len(flown.module(name)) < (200_000 if name == PLAIN else 230_000)


@pytest.mark.parametrize("name", MODULES)
def test_the_types_that_snapshots_tell_are_numbas(name):
    for _, _, arguments in functions(name):
        leaves = [leaf for leaf in arguments.leaves(Memory()) if ":" not in leaf.name]
        assert [leaf.type for leaf in leaves] == [str(each) for each in inner_types(arguments.kinds)]


def inner_types(kinds):
    for kind in kinds:
        yield from inner_types(kind.types) if isinstance(kind, types.BaseTuple) else (kind,)


def test_what_no_module_takes_is_refused():
    for value, words in (
        (np.zeros((4, 4))[:, ::2], "no contiguous array"),
        (np.zeros(2, ">f8"), "no contiguous array"),
        (np.float32(1.0), "of the type float32"),
        ("word", "of the type str"),
    ):
        with pytest.raises(TypeError, match=words):
            list(leaves_of(Memory(), (value,), "given"))
