"""The player of a page: it flies what the product flies, bit for bit, and all panels show one time."""

import base64
import csv
import json
import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numba import types
from playwright.sync_api import expect

from benchmarks.scaling import words_of
from fis_tools.model.thrust import REASONS, SILENT_N
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.control.controller import PlanningController
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.goals.reach import until_end
from pipeline.flight.world.pack import pack_world
from pipeline.physics.quaternion import dcms_b_from_h
from pipeline.player import flown
from pipeline.player.arguments import MODULES, PLAIN
from pipeline.player.build import FOLDER, functions
from pipeline.player.flown import FlownCases, flown_in_page, looks_ahead, tells_reasons
from pipeline.player.memory import Memory, leaves_of, types_of
from pipeline.player.panel import panel
from pipeline.player.runs import Carried, CaseColumn, CasePlot, PlayedCases, PlayedPage, PlayedRun
from pipeline.recording.points import lit_and_seen
from pipeline.report.case_measures import MEASURES
from pipeline.report.played import carried_of, player_of_starts
from pipeline.report.scene import recorded_table
from pipeline.scenarios import evaluation_scenarios
from pipeline.settings.experiment import Mission, SettingError
from pipeline.settings.places import conf_folder
from plain_files.document.html import policy
from tests import night
from tests.browser import serious_violations
from tests.places import PROJECT

pytestmark = pytest.mark.slow

NUM_CASES = 16
#: tenths of a second that a busy machine may take for a picture
PAINTS = 100
NUMBER = f"monte_carlo.num_cases={NUM_CASES}"
#: a module flies any mission of its types: controllers, limits, masses, durations and layers differ
FLOWN = (
    ("champion_27",),
    ("champion_27", "safety=filter", "deputy.mass_kg=20", "duration_s=2400"),
    ("champion_27_parking",),
)
#: light other than the paper's
ELEVATED = "sun.elevation_range_deg=[-30,30]"
#: cases of controllers that look ahead or plan, each of which takes long to choose
NUM_AHEAD = 4
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
TURNING = "chief.initial_angular_velocity_rad_s=[0.001,0,0.002]"
#: a true course of the chief, along which all that deputies predict goes, and a Sun that moves
COURSES = (
    ("champion_27", "dynamics=two_body", *ELLIPSE, "sun=random", ELEVATED),
    ("champion_leo", "dynamics=low_orbit", *ELLIPSE, "navigation=fixes", "actuators=real", "sun=random"),
    ("champion_27", "dynamics=two_body", *STEEP, TURNING, "safety=filter", "sun=random"),
    ("champion_leo_rehearsed", "dynamics=two_body", *STEEP, "light=shadow", "sun=random", "duration_s=1800"),
    ("champion_27", "dynamics=low_orbit", "orbit.course=true", "orbit.epoch=2026-11-26T12:00:00", TURNING),
)
#: reasons by their indices in logs, and those of what was not fired
NAMES = list(REASONS)
NOT_FIRED = [name for name, text in REASONS.items() if re.search(r"not fired|or fired|yet to fire", text)]
GIVEN = [f"{REASONS[name][:1].upper()}{REASONS[name][1:]}." for name in ("rehearsed", "parked")]
#: bytes of an array as text
TEXT = """array => {
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength); let out = "";
    for (const byte of bytes) out += String.fromCharCode(byte);
    return btoa(out);
}"""
LOG = """async row => {
    const side = player.sides[0], text = TEXT;
    const log = await side.ask(side.caseOf(row));
    return Object.fromEntries(Object.entries(log).map(([name, array]) => [name, text(array)]));
}""".replace("TEXT", TEXT)


def shipped(group):
    return sorted(path.stem for path in (conf_folder() / group).glob("*.yaml"))


def docks(name):
    """Return whether a controller is for docking: it is compared in that alone, or flies no inspection."""
    docking, inspecting = (
        compose_experiment([f"+experiment={name}"]).experiment.compare.controllers
        for name in ("compare_docking", "baselines")
    )
    if name in set(docking) - set(inspecting):
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


@cache
def run_of(*words):
    """Return a mission, a controller, fresh starts, and their flights as the product flies and logs them."""
    name, *others = words
    job = compose_experiment(
        [
            "+experiment=evaluate",
            f"controller={name}",
            *(() if any(word.startswith(("world=", "sun=")) for word in others) else ("sun=random",)),
            "seed=91",
            f"monte_carlo.num_cases={NUM_CASES}",
            *others,
        ]
    ).experiment
    controller = source.load(job.controller, job.mission)
    chooses = looks_ahead(controller) or isinstance(controller, PlanningController)
    starts = evaluation_scenarios(job)[: NUM_AHEAD if chooses else NUM_CASES]
    return job.mission, controller, starts, [fly_logged(job.mission, controller, start) for start in starts]


def cases_of(logs):
    """Return cases as a player takes them."""
    far = np.array([np.linalg.norm(log.position_m, axis=1) for log in logs])
    fuel = np.array([log.delta_v_m_s[-1] for log in logs])
    rate = np.array([100.0 * log.is_inspected[-1].mean() for log in logs])
    columns = [
        CaseColumn("delta_v_m_s", "Δv, m/s", 3, fuel),
        CaseColumn("inspection_rate_percent", "inspected, %", 1, rate),
        CaseColumn("min_distance_m", "nearest, m", 1, far.min(axis=1)),
        CaseColumn("max_distance_m", "farthest, m", 1, far.max(axis=1)),
    ]
    return PlayedCases(np.arange(len(logs)) + 100, [rate >= 95.0], columns, MEASURES["inspection"].plots)


@cache
def page_of(*words, recorded=()):
    mission, controller, starts, logs = run_of(*words)
    run = PlayedRun("A", "trial", mission, controller, starts, [3], "fly RUN case=CASE")
    carried = carried_of(run)
    if recorded:
        tables = {row: recorded_table(logs[row], controller, mission) for row in recorded}
        carried = Carried(recorded=tables, why="it is a trial")
    return as_page(panel(PlayedPage("", "trial", [(run, carried)], cases_of(logs), 3)))


def as_page(shown):
    """Return a panel as a page of its own."""
    head = f'<!doctype html><html lang="en"><meta charset="utf-8">{policy(scripts=shown.scripts, flies=True)}'
    head += '<meta name="viewport" content="width=device-width"><title>A run</title>'
    ours = ":root { color-scheme: light dark; } body { margin: 8px; background: var(--card); }"
    body = f"<body class=page><main><h1>A run</h1><h2>Cases</h2>{shown.body}</main>"
    return f"{head}<style>{ours} {shown.style}</style>{body}<script>{shown.script}</script>"


@pytest.fixture
def ready(opened):
    """Open a page, and wait for its first flight."""

    def open_page(*words, width=1280, address="", recorded=(), **options):
        page = opened(page_of(*words, recorded=recorded), width, reduced_motion="reduce", **options)
        # a busy machine may take long to compile the module
        page.wait_for_function("() => globalThis.player?.sides?.[0].flight", timeout=300_000)
        if address:
            case = address.partition("case=")[2].partition("&")[0]
            page.evaluate("address => { location.hash = address; }", address)
            page.wait_for_function("number => player.cases.numbers[player.row] === number", arg=int(case))
        return page

    return open_page


def shows(page, number):
    page.wait_for_function(
        """number => player.cases.numbers[player.row] === number
            && player.part('which').textContent.endsWith(`Case ${number}`)""",
        arg=number,
    )


def decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


@pytest.mark.parametrize("words", FLOWN, ids="-".join)
def test_a_page_flies_fresh_cases_to_the_products_bits(ready, words):
    assert_flown(ready(*words), run_of(*words)[3], range(NUM_CASES))


#: all by night, also those that look far ahead
MISSIONS = night.by_day([*worlds(), *OTHERS, *COURSES], 6)


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


@pytest.mark.parametrize("words", FLOWN, ids="-".join)
def test_reasons_and_rules_are_the_products(ready, words):
    mission, controller, _, logs = run_of(*words)
    page, names, num_named = ready(*words), list(REASONS), 0
    for row in (3, 7):
        page.evaluate("row => player.open(row)", row)
        shows(page, 100 + row)
        reasons = page.evaluate(
            """() => Array.from({ length: player.sides[0].flight.numSamples - 1 }, (_, k) =>
                [0, 1, 2].map(axis => player.sides[0].flight.reason(k, axis)))"""
        )
        assert reasons == [[names[code] for code in codes] for codes in logs[row].reason.tolist()]
        table = recorded_table(logs[row], controller, mission)
        for k, axis in np.argwhere(logs[row].force_hill_n != 0.0)[:40].tolist():
            text = table["texts"][table["reasons"][k][axis]]
            if text.startswith("If "):
                named = page.evaluate(
                    "([k, axis]) => player.sides[0].shared.pushed(player.sides[0].flight, k, axis)", [k, axis]
                )
                assert named.partition(": ")[2] == text
                num_named += 1
    assert num_named > 20


#: what pushes between two decisions, or along other axes than those along which rules ask
REASONED = (
    ("champion_27", "safety=filter", "deputy.max_distance_m=70"),
    ("champion_27", "navigation=fixes", "actuators=real", "safety=robust"),
    ("champion_27", "actuators=real", "actuators.delay_s=20"),
    ("champion_27_parked",),
    ("champion_27_parking", "actuators=real", "actuators.delay_s=10"),
    ("lqr", "actuators=real"),
    ("paper",),
    ("paper_champion", "actuators=real", "actuators.delay_s=10", "safety=filter"),
)


@pytest.mark.parametrize("words", REASONED, ids="-".join)
def test_a_page_tells_of_each_push_and_of_no_other(ready, words):
    assert_told(ready(*words), *run_of(*words), 3)


def assert_told(page, mission, controller, starts, logs, row):
    """Fail where the open flight's words contradict what the product logged of a row."""
    log = until_end(mission, logs[row])
    forces = np.where(np.abs(log.force_hill_n) < SILENT_N, 0.0, log.force_hill_n)
    rows = page.evaluate(
        "() => Array.from({ length: player.sides[0].flight.numSamples - 1 }, (_, k) =>"
        " player.sides[0].flight.reasons(k))"
    )
    assert len(rows) == len(forces)
    for k, (force, lines) in enumerate(zip(forces, rows, strict=True)):
        words = [NAMES[code] for code in log.reason[k]]
        said = {each["detail"] for each in lines}
        if force.any():
            assert len(lines) == np.count_nonzero(force), (k, lines)
            assert all(each["text"].startswith("Push ") for each in lines), (k, lines)
            assert said.isdisjoint(capital(REASONS[name]) for name in NOT_FIRED), (k, lines)
        elif lines[0]["text"] == "No push.":
            (text,) = said
            assert text in {capital(REASONS[name]) for name in words}, (k, lines, words)
            # what was given is not said of what was not fired yet
            assert text != capital(REASONS["silent"]) or set(words) == {"silent"}, (k, words)
            assert text not in GIVEN or set(words) <= {"rehearsed", "parked", "silent"}, (k, words)
        else:  # of the last decision
            assert lines[0]["text"].startswith("At "), (k, lines)
    buttons = page.locator("#player .bouts button").all_inner_texts()
    more = [re.search(r" and (\d+) more until ", text) for text in buttons]
    assert sum(int(match[1]) + 1 if match else 1 for match in more) == np.sum(forces.any(axis=1))
    assert buttons


def capital(text):
    return f"{text[:1].upper()}{text[1:]}."


#: a chief at rest, and one that turns; light that a page does not work out, without free motion in the last
LIT = (
    ("champion_27",),
    ("champion_27", TURNING),
    ("champion_27", ELEVATED, "sun=random"),
    ("champion_leo", "world=leo"),
)
#: whether points are lit at a sample, what is drawn of the deputy on their map, and what is said
SHOWN_OF = """k => {
    const [side] = player.sides, { flight } = side;
    player.lead.view.show(k);
    side.show(k * flight.periodS);
    return {
        lit: flight.isLit ? flight.points.map((_, j) => flight.isLit(k, j)) : null,
        cross: side.part("map").querySelector("path").getAttribute("transform"),
        map: side.part("map").querySelector("p").textContent, key: side.part("key").textContent,
        path: Boolean(flight.coast(k)), said: flight.reasons(k).map(({ detail }) => detail).join(" "),
    };
}"""


@pytest.mark.parametrize("words", LIT, ids="-".join)
def test_a_page_says_which_points_are_lit_and_what_is_dashed_only_where_it_shows_it(ready, words):
    mission, _, _, logs = run_of(*words)
    page, log, world = ready(*words), logs[3], pack_world(mission)
    is_lit, _ = lit_and_seen(world, log)
    turns = dcms_b_from_h(log.quaternion_c_from_h)
    for k in (0, 60, 200, mission.num_controls):
        shown = page.evaluate(SHOWN_OF, k)
        assert ("lit" in shown["key"], "Ring: lit" in shown["map"]) == (shown["lit"] is not None,) * 2
        assert ("dark" in shown["key"]) == (shown["lit"] is not None)
        if shown["lit"] is not None:
            sun = np.array([np.cos(log.sun_angle_rad[k]), np.sin(log.sun_angle_rad[k]), 0.0])
            sample = k if len(world.points) > 1 else 0
            heights = world.points[sample, :, : world.num_points].T @ sun
            counts = ~log.is_inspected[k] & (np.abs(heights) > 1e-6)  # grazing light is a matter of rounding
            assert np.array_equal(np.array(shown["lit"])[counts], is_lit[k][counts])
        x, y, z = turns[0].T @ turns[k] @ log.position_m[k]
        longitude, latitude = np.degrees([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))])
        cross = [float(part) for part in shown["cross"].removeprefix("translate(").rstrip(")").split(",")]
        np.testing.assert_allclose(cross, [180.0 + longitude, 88.0 * (1.0 - latitude / 90.0)], atol=1e-3)
        assert ("dashed" in shown["said"]) == (k == mission.num_controls and shown["path"])


def test_presses_and_keys_open_cases(ready):
    page = ready("champion_27")
    box = page.locator(".fuel-dots canvas").bounding_box()
    x, y = page.evaluate("() => player.dots[0].where(8)")
    page.locator(".fuel-dots canvas").scroll_into_view_if_needed()
    box = page.locator(".fuel-dots canvas").bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_function("() => player.row !== 3")
    assert page.evaluate("() => [player.row, player.cases.numbers[player.row]]") == [8, 108]
    page.get_by_role("button", name="Open case", exact=False).nth(2).click()
    costly = np.argsort([-log.delta_v_m_s[-1] for log in run_of("champion_27")[3]], kind="stable")
    shows(page, 100 + int(costly[2]))
    page.locator(".fuel-dots canvas").focus()
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Enter")
    shows(page, 100 + int(costly[3]))
    bar = page.locator(".bars rect.bar").last
    bar.focus()
    page.keyboard.press("Enter")
    shows(page, 100 + int(costly[0]))


def test_all_panels_show_one_time_and_the_address_keeps_it(ready):
    page = ready("champion_27", address="run=trial&case=105&k=124")
    log = run_of("champion_27")[3][5]
    read = """() => {
        const all = words => [...document.querySelectorAll(`#player ${words}`)];
        return { k: player.sides[0].view.sample, slider: +document.querySelector("#player .time").value,
            plots: all("svg[role=slider]").map(each => +each.getAttribute("aria-valuenow")),
            values: all("svg text.now").map(each => each.textContent) };
    }"""
    for key, k in (("", 124), ("ArrowRight", 125), ("PageUp", 95), ("Home", 0), ("End", 360)):
        if key:
            page.locator("#player .distance svg").focus()
            page.keyboard.press(key)
        page.wait_for_function("k => player.sides[0].view.heard === k", arg=k)
        seen = f"{log.is_inspected[k].sum()}"
        values = [f"{np.linalg.norm(log.position_m[k]):.1f} m", f"{log.delta_v_m_s[k]:.3f} m/s", seen]
        expect(page.locator("#player .count")).to_contain_text(f"{seen} of 99 points")
        for _ in range(PAINTS):  # each panel is painted with the next picture of the screen
            shown = page.evaluate(read)
            if shown["values"] == values:
                break
            page.wait_for_timeout(100)
        assert shown["values"] == values
        assert (shown["k"], shown["slider"], set(shown["plots"])) == (k, k, {k})
    page.wait_for_function("() => location.hash === '#run=trial&case=105&k=360'")
    expect(page.locator("#player .why")).to_have_text(re.compile(r"^\s*The flight ends here\."))


#: points of a drag by a finger, of 10 by 4 pixels each
NUM_DRAGGED = 16
#: what such a drag may move
MOVED = "() => [player.lead.view.angles.yaw, player.lead.view.angles.pitch, player.lead.view.sample]"


def test_a_drag_by_finger_turns_the_view_and_moves_the_time_but_no_page(ready):
    page = ready("champion_27", width=400, has_touch=True, is_mobile=True)
    fingers = page.context.new_cdp_session(page)

    def drag(part):
        """Drag up and to the left by a finger from the middle of a part; return how far the page scrolled."""
        element = page.locator(f"#player {part}").first
        element.evaluate("each => each.scrollIntoView({ block: 'center' })")
        box = element.bounding_box()
        before = page.evaluate("() => scrollY")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        for step in range(NUM_DRAGGED):
            points = [{"x": x - 4 * step, "y": y - 10 * step}]
            kind = "touchMove" if step else "touchStart"
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
            page.wait_for_timeout(16)
        fingers.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        page.wait_for_timeout(300)
        return page.evaluate("() => scrollY") - before

    assert drag(".distance h4") > 100  # elsewhere it does
    yaw, pitch, k = page.evaluate(MOVED)
    assert drag(".scene canvas") == 0
    turned_yaw, turned_pitch, same = page.evaluate(MOVED)
    assert turned_yaw - yaw > 0.3
    assert pitch - turned_pitch > 0.3
    assert same == k
    for plot in (".distance", ".fuel", ".progress"):
        page.evaluate("() => player.lead.view.show(350)")
        assert drag(f"{plot} svg[role=slider]") == 0
        page.wait_for_function("() => player.lead.view.sample < 200")


def test_numbers_and_pictures_are_saved(ready, tmp_path):
    page = ready("champion_27", address="case=102&k=10")
    log = run_of("champion_27")[3][2]
    with page.expect_download() as waiting:
        page.get_by_role("button", name="CSV of Distance from the chief").click()
    assert waiting.value.suggested_filename == "trial-case-102-distance.csv"
    waiting.value.save_as(tmp_path / "distance.csv")
    rows = list(csv.DictReader((tmp_path / "distance.csv").read_text().splitlines()))
    far = np.linalg.norm(log.position_m, axis=1)
    np.testing.assert_allclose([float(row["distance_m"]) for row in rows[:361]], far, rtol=1e-12)
    for kind, start in (("SVG", b"<svg"), ("PNG", b"\x89PNG")):
        with page.expect_download() as waiting:
            page.get_by_role("button", name=f"{kind} of Δv spent").click()
        waiting.value.save_as(tmp_path / "picture")
        assert (tmp_path / "picture").read_bytes().startswith(start)


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


def test_cases_that_a_page_does_not_carry_say_how_to_fly_them(ready):
    _, _, _, logs = run_of("champion_27")
    page = ready("champion_27", recorded=(3, 5))
    assert page.evaluate("() => player.sides[0].flight.spent(360)") == pytest.approx(
        logs[3].delta_v_m_s[-1], rel=1e-6
    )
    page.evaluate("() => player.open(5)")
    shows(page, 105)
    position = page.evaluate("() => player.sides[0].flight.position(200)")
    np.testing.assert_allclose(position, logs[5].position_m[200], rtol=1e-6)
    page.evaluate("() => player.open(6)")
    page.get_by_text("fly RUN case=106").wait_for()
    shows(page, 105)


def test_reasons_that_are_not_told_by_what_is_flown_are_the_products(ready):
    mission, controller, _, logs = run_of("champion_27_rehearsed")
    assert not tells_reasons(mission, controller)
    page = ready("champion_27_rehearsed")
    table = recorded_table(logs[3], controller, mission)
    k = int(np.flatnonzero(logs[3].force_hill_n.any(axis=1))[0])
    axis = int(np.argmax(np.abs(logs[3].force_hill_n[k])))
    details = page.evaluate("k => player.sides[0].flight.reasons(k).map(({ detail }) => detail)", k)
    assert table["texts"][table["reasons"][k][axis]] in details


AT_SAMPLE = "k => player.sides.every(({ view }) => view.sample === k && view.heard === k)"
COMPARED = ("champion_27", "champion_27_parking")


@pytest.fixture(scope="module")
def compared():
    """A page of two runs side by side."""
    runs = [(name, *run_of(name)) for name in COMPARED]
    cases = cases_of(runs[0][4])
    fuel = [np.array([log.delta_v_m_s[-1] for log in logs]) for *_, logs in runs]
    columns = [CaseColumn(f"fuel_{letter}", letter, 3, each) for letter, each in zip("AB", fuel, strict=True)]
    plots = [CasePlot("fuel-B", "B beside A", ("fuel_A", "fuel_B"), is_paired=True)]
    cases = PlayedCases(cases.numbers, [cases.succeeds[0]] * 2, columns, plots)
    played = [
        PlayedRun(name, name, mission, controller, starts) for name, mission, controller, starts, _ in runs
    ]
    return as_page(panel(PlayedPage("", "two", [(run, carried_of(run)) for run in played], cases, 3)))


def test_runs_fly_a_case_side_by_side_under_one_time(opened, compared):
    page = opened(compared, 1400, reduced_motion="reduce")
    page.wait_for_function("() => globalThis.player?.sides?.every(side => side.flight)")
    x, y = page.evaluate("() => player.dots[0].where(8)")
    canvas = page.locator(".fuel-B canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.mouse.click(box["x"] + x, box["y"] + y)
    page.wait_for_function("() => player.row === 8")
    spent = page.evaluate("() => player.sides.map(side => side.flight.spent(360))")
    assert spent == [run_of(name)[3][8].delta_v_m_s[-1] for name in COMPARED]
    page.locator(".side").nth(1).locator(".distance svg").focus()
    for key, k in (("Home", 0), ("PageDown", 30), ("ArrowRight", 31)):
        page.keyboard.press(key)
        page.wait_for_function(AT_SAMPLE, arg=k)
        sliders = page.locator("#player svg[role=slider]")
        assert {each.get_attribute("aria-valuenow") for each in sliders.all()} == {str(k)}
    assert page.locator("#player .playback:visible").count() == 1
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 1400


#: by day each width and each scheme
SHOWN = night.by_day([(400, "light"), (400, "dark"), (1400, "dark"), (1400, "light"), (1920, "light")], 2)


@pytest.mark.parametrize(("width", "scheme"), [each for each in SHOWN if each[0] < 1920])
def test_runs_side_by_side_fit_and_axe_finds_nothing(opened, compared, axe, width, scheme):
    page = opened(compared, width, reduced_motion="reduce", color_scheme=scheme)
    page.wait_for_function("() => globalThis.player?.sides?.every(side => side.flight)")
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_page_of_ten_thousand_cases_is_small():
    mission, controller, starts, logs = run_of("champion_27")
    drawn = np.random.default_rng(0).normal(size=(10_000, 3))
    many = [replace(starts[0], position_m=75.0 * row / np.linalg.norm(row)) for row in drawn]
    run = PlayedRun("A", "trial", mission, controller, many)
    values = np.random.default_rng(1).random(10_000)
    columns = [replace(column, values=values) for column in cases_of(logs).columns]
    cases = PlayedCases(np.arange(10_000), [values > 0.1], columns, MEASURES["inspection"].plots)
    assert len(as_page(panel(PlayedPage("", "many", [(run, carried_of(run))], cases)))) < 1_500_000


@pytest.mark.parametrize(("width", "scheme"), [*SHOWN, *([(1920, "dark")] if night.IS_WHOLE else [])])
def test_the_player_fits_and_axe_finds_nothing(ready, axe, width, scheme):
    page = ready("champion_27", width=width, color_scheme=scheme)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_player_of_a_thousand_cases_adds_little_to_a_page():
    words = ("+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=1000")
    job = compose_experiment(words).experiment
    controller = source.named("champion_27", job.mission)
    shown = player_of_starts(job, job.mission, controller, evaluation_scenarios(job))
    assert sum(len(part.encode()) for part in (shown.style, shown.body, shown.script)) < 200_000
