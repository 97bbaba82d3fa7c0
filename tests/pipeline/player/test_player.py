"""The player of a page: it flies what the product flies, bit for bit, and all panels show one time."""

import base64
import csv
import json
import re
from functools import cache

import numpy as np
import pytest
from playwright.sync_api import expect

from fis_tools.document.html import policy
from fis_tools.model.thrust import REASONS
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.flight.fly.simulation import fly_logged
from pipeline.flight.state.arrays import CASE
from pipeline.flight.state.log import Scenario
from pipeline.player.arguments import arguments_of
from pipeline.player.build import functions
from pipeline.player.memory import Memory, types_of
from pipeline.player.panel import CaseColumn, PlayedCases, PlayedRun, module, panel, why_recorded
from pipeline.report.scene import recorded_table
from pipeline.scenarios import evaluation_scenarios
from tests.browser import serious_violations

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
LOG = """async row => {
    const log = await player.ask({ start: player.starts.slice(8 * row, 8 * row + 8) });
    const text = array => {
        const bytes = new Uint8Array(array.buffer); let out = "";
        for (const byte of bytes) out += String.fromCharCode(byte);
        return btoa(out);
    };
    return Object.fromEntries(Object.entries(log).map(([name, array]) => [name, text(array)]));
}"""


@cache
def run_of(*words):
    """Return a mission, a controller, fresh starts, and their flights as the product flies and logs them."""
    name, *others = words
    job = compose_experiment(
        [
            "+experiment=evaluate",
            f"controller={name}",
            "sun=random",
            "seed=91",
            f"monte_carlo.num_cases={NUM_CASES}",
            *others,
        ]
    ).experiment
    controller = source.named(name, job.mission)
    starts = evaluation_scenarios(job)
    return job.mission, controller, starts, [fly_logged(job.mission, controller, start) for start in starts]


def played(*words, **changes):
    """Return a run as a player takes it."""
    mission, controller, starts, logs = run_of(*words)
    table = np.zeros(NUM_CASES, CASE)
    for row, start in zip(table, starts, strict=True):
        row["position"], row["velocity"] = start.position_m, start.velocity_m_s
        row["sun_angle"], row["sun_elevation"] = start.sun_angle_rad, start.sun_elevation_rad
    far = np.array([np.linalg.norm(log.position_m, axis=1) for log in logs])
    fuel = np.array([log.delta_v_m_s[-1] for log in logs])
    rate = np.array([100.0 * log.is_inspected[-1].mean() for log in logs])
    columns = [
        CaseColumn("delta_v_m_s", "Δv, m/s", 3, fuel),
        CaseColumn("inspection_rate_percent", "inspected, %", 1, rate),
        CaseColumn("min_distance_m", "nearest, m", 1, far.min(axis=1)),
        CaseColumn("max_distance_m", "farthest, m", 1, far.max(axis=1)),
    ]
    cases = PlayedCases(np.arange(NUM_CASES) + 100, rate >= 95.0, table, columns)
    return PlayedRun("", "trial", mission, controller, "fly RUN case=CASE", cases, 3, **changes)


@cache
def page_of(*words, recorded=()):
    mission, controller, _, logs = run_of(*words)
    tables = {row: recorded_table(logs[row], controller, mission) for row in recorded}
    shown = panel(played(*words, recorded=tables))
    head = f'<!doctype html><html lang="en"><meta charset="utf-8">{policy(script=shown.script, flies=True)}'
    head += '<meta name="viewport" content="width=device-width"><title>A run</title>'
    ours = ":root { color-scheme: light dark; } body { margin: 8px; background: var(--card); }"
    body = f"<body class=page><main><h1>A run</h1><h2>Cases</h2>{shown.body}</main>"
    return f"{head}<style>{ours} {shown.style}</style>{body}<script>{shown.script}</script>"


@pytest.fixture
def ready(opened):
    """Open a page, and wait for its first flight."""

    def open_page(*words, width=1280, address="", recorded=(), **options):
        page = opened(page_of(*words, recorded=recorded), width, reduced_motion="reduce", **options)
        page.wait_for_function("() => player.flight")
        if address:
            case = address.partition("case=")[2].partition("&")[0]
            page.evaluate("address => { location.hash = address; }", address)
            page.wait_for_function("number => player.cases.numbers[player.row] === number", arg=int(case))
        return page

    return open_page


NAMED = "([k, axis]) => player.shared.pushed(player.flight, k, axis)"


def shows(page, number):
    page.wait_for_function(
        """number => player.cases.numbers[player.row] === number
            && player.part('which').textContent === `Case ${number}`""",
        arg=number,
    )


def decoded(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


@pytest.mark.parametrize("words", FLOWN, ids="-".join)
def test_a_page_flies_fresh_cases_to_the_products_bits(ready, words):
    logs = run_of(*words)[3]
    page = ready(*words)
    for row, log in enumerate(logs):
        again = page.evaluate(LOG, row)
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
            """() => Array.from({ length: player.flight.numSamples - 1 }, (_, k) =>
                [0, 1, 2].map(axis => player.flight.reason(k, axis)))"""
        )
        assert reasons == [[names[code] for code in codes] for codes in logs[row].reason.tolist()]
        table = recorded_table(logs[row], controller, mission)
        for k, axis in np.argwhere(logs[row].force_hill_n != 0.0)[:40].tolist():
            text = table["texts"][table["reasons"][k][axis]]
            if text.startswith("If "):
                named = page.evaluate(
                    "([k, axis]) => player.shared.pushed(player.flight, k, axis)", [k, axis]
                )
                assert named.partition(": ")[2] == text
                num_named += 1
    assert num_named > 20


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
        return { k: player.view.sample, slider: +document.querySelector("#player .time").value,
            plots: all("svg[role=slider]").map(each => +each.getAttribute("aria-valuenow")),
            values: all("svg text.now").map(each => each.textContent) };
    }"""
    for key, k in (("", 124), ("ArrowRight", 125), ("PageUp", 95), ("Home", 0), ("End", 360)):
        if key:
            page.locator("#player .distance svg").focus()
            page.keyboard.press(key)
        page.wait_for_function("k => player.view.heard === k", arg=k)
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


def test_a_module_refuses_a_snapshot_of_other_types(ready):
    page = ready("champion_27")
    message = page.evaluate(
        """async () => {
            const { module, snapshot } = player.page, other = structuredClone(snapshot);
            other.functions.fly.types += 1;
            const ask = player.beginWorker(player.page.worker);
            return ask({ module, snapshot: other }).then(() => "", error => error.message);
        }"""
    )
    assert "is of other types than its snapshot" in message


def test_the_module_is_of_the_types_that_the_product_has():
    types = {name: types_of(arguments.leaves(Memory())) for name, _, arguments in functions()}
    text = (module_folder() / "types.json").read_text(encoding="utf-8")
    assert json.loads(text) == types
    assert len(module()) < 200_000


def module_folder():
    from pipeline.player.build import FOLDER  # noqa: PLC0415 - beside the module

    return FOLDER


def test_what_the_module_does_not_fly_is_recorded_or_says_how_to_fly_it(ready):
    mission, controller, _, logs = run_of("champion_27_rehearsed")
    assert why_recorded(mission, controller) == "its pushes were chosen by flights ahead"
    page = ready("champion_27_rehearsed", recorded=(3, 5))
    assert page.evaluate("() => player.flight.spent(360)") == pytest.approx(logs[3].delta_v_m_s[-1], rel=1e-6)
    page.evaluate("() => player.open(5)")
    shows(page, 105)
    position = page.evaluate("() => player.flight.position(200)")
    np.testing.assert_allclose(position, logs[5].position_m[200], rtol=1e-6)
    page.evaluate("() => player.open(6)")
    page.get_by_text("fly RUN case=106").wait_for()
    shows(page, 105)


@pytest.mark.parametrize("words", ["world=rso", "navigation=fixes", "guidance=clusters"])
def test_missions_of_other_types_have_no_snapshot(words):
    name = "champion_rso" if words == "world=rso" else "champion_27"
    job = compose_experiment(["+experiment=evaluate", f"controller={name}", words]).experiment
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.0)
    assert arguments_of(job.mission, source.named(name, job.mission), [start]) is None


@pytest.mark.parametrize("width", [400, 1400, 1920])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_player_fits_and_axe_finds_nothing(ready, axe, width, scheme):
    page = ready("champion_27", width=width, color_scheme=scheme)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
    assert serious_violations(page, axe) == []


def test_a_player_adds_little_to_a_page():
    assert len(page_of("champion_27")) < 400_000
