"""What a page says of pushes, rules and points is what the product logs."""

import numpy as np
import pytest

from fis_tools.model.thrust import REASONS
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.world.pack import pack_world
from pipeline.physics.quaternion import dcms_b_from_h
from pipeline.player.flown import tells_reasons
from pipeline.recording.points import lit_and_seen
from pipeline.report.scene import recorded_table
from tests.pipeline.evaluation.propagated import linear
from tests.pipeline.player.pages import ELEVATED, FLOWN, TURNING, run_of, shows
from tests.pipeline.player.statements import assert_told

pytestmark = pytest.mark.slow


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


def test_reasons_that_are_not_told_by_what_is_flown_are_the_products(ready):
    mission, controller, _, logs = run_of("champion_27_rehearsed")
    assert not tells_reasons(mission, controller)
    page = ready("champion_27_rehearsed")
    table = recorded_table(logs[3], controller, mission)
    k = int(np.flatnonzero(logs[3].force_hill_n.any(axis=1))[0])
    axis = int(np.argmax(np.abs(logs[3].force_hill_n[k])))
    details = page.evaluate("k => player.sides[0].flight.reasons(k).map(({ detail }) => detail)", k)
    assert table["texts"][table["reasons"][k][axis]] in details


#: orbits of cases, of one and three quarters to seven hours
ORBITS = "+dispersions.orbit.mean_motion_rad_s={kind:uniform,low:0.00025,high:0.001}"
#: what a page follows after the end: distances at samples, and where the dashed path of the scene has come to
FOLLOWED = """k => {
    const [side] = player.sides;
    return { distances: side.freeDistances(k), path: side.flight.coast(k).map(each => Math.hypot(...each)) };
}"""


def test_what_follows_a_flight_is_in_the_orbit_that_its_case_has_drawn(ready):
    mission, _, starts, logs = run_of("champion_27", ORBITS)
    log, rate = logs[3], mission_of_case(mission, starts[3]).orbit.mean_motion_rad_s
    assert rate < 0.9 * mission.orbit.mean_motion_rad_s
    shown = ready("champion_27", ORBITS).evaluate(FOLLOWED, mission.num_controls)
    state = np.concatenate([log.position_m[-1], log.velocity_m_s[-1]])
    times = mission.control_period_s * np.arange(len(shown["distances"]))
    # a plot has straight lines between the samples of an orbit
    np.testing.assert_allclose(shown["distances"], linear(rate, state, times), atol=0.5)
    times = np.linspace(0.0, 2.0 * np.pi / rate, len(shown["path"]))
    np.testing.assert_allclose(shown["path"], linear(rate, state, times), rtol=1e-4, atol=1e-2)
