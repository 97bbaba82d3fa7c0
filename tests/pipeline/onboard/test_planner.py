"""A planner in C: it plans what the product plans, bit for bit, within the periods that it is given."""

import ctypes
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from fis_tools.compiled.vectors import Three
from fis_tools.formats import serialize
from fis_tools.formats.c.text import WARNINGS
from fis_tools.formats.serialize import content_hash
from pipeline.flight.control.controller import from_fuzzy
from pipeline.flight.fly.aboard import predict
from pipeline.flight.fly.lesser_controllers import finishing
from pipeline.flight.fly.outlooks import at_start
from pipeline.flight.fly.pushes import Effort, search_pushes
from pipeline.flight.fly.replanning import AGAIN_ON_BOARD, FIRST, first_searches, foresees
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.state.log import REHEARSED
from pipeline.flight.world.pack import pack_world
from pipeline.onboard.export import export, joined
from pipeline.onboard.messages import FIELD_BITS, MODES, START_BITS
from pipeline.onboard.program import translate
from pipeline.onboard.recorded import OUTPUT, Library, differing, recorded
from pipeline.onboard.search import MOST_TRIED, num_tried
from pipeline.onboard.source import sources
from pipeline.settings.mission import TwoBody
from pipeline.settings.orbit import OrbitSettings
from tests import night
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.flight.cases import mission, random_starts

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc compiles what is written"),
]
SHORT = mission(duration_s=1200.0)
EVERY = {name: from_fuzzy(serialize.load(path)) for name, path in SHIPPED.items()}
PLANNING = {name: each for name, each in EVERY.items() if foresees(each)}
#: little effort, which is enough for what is tried here
QUICK = {2: Effort(16, 9), 3: Effort(24, 9)}
#: where a deputy knows neither where it is nor what it fires for certain
ERRORS = {"navigation": {"mode": "fixes"}, "actuators": {"kind": "real"}}
NOISY = mission(duration_s=1200.0, **ERRORS)
CAMERA = {"sensor": {"max_incidence_deg": 70.0, "max_range_m": 90.0}, "light": {"shadow": "conical"}}
ELLIPSE = {
    "orbit": OrbitSettings(
        kind="elements", semi_major_axis_m=9.6e6, eccentricity=0.3, true_anomaly_deg=290.0
    ),
    "dynamics": TwoBody(j2=1.08e-3),
}
WEAK = {"deputy": {"max_force_n": 0.02}, "safety": {"kind": "filter"}}
TURNING = {"chief": {"initial_angular_velocity_rad_s": (0.01, 0.0, 0.0)}}
#: bits of the status, as the header defines them
BAD_POSITION, BAD_START = 2, 64
#: what writes into a state how many periods ahead it plans, and reads where a plan begins
SHIM = """
void set_lead(struct controller *state, int lead) { state->plan_lead = lead; }
void read_plan(const struct controller *state, double *begins)
{
    for (int i = 0; i < 6; ++i) {
        begins[i] = state->plan_state[i];
    }
}
"""


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        for num_pushes, effort in QUICK.items():
            patch.setitem(FIRST, num_pushes, effort)
            patch.setitem(AGAIN_ON_BOARD, num_pushes, (effort,))
        yield


def written(program, folder):
    source = sources(program)
    (folder / "controller.h").write_text(source.header)
    (folder / "controller.c").write_text(source.code + SHIM)
    return Library(folder, flags=("-std=c99", "-O1", "-ffp-contract=off"))


@pytest.fixture(scope="module", params=PLANNING)
def planning(request, tmp_path_factory):
    program = translate(SHORT, PLANNING[request.param])
    return program, written(program, tmp_path_factory.mktemp("planning"))


def test_c_flies_the_plan_that_the_product_flies(planning):
    program, library = planning
    num_planned = 0
    for start in random_starts(3, seed=7):
        log = fly_logged(SHORT, program.controller, start)
        flight = recorded(program, start, log)
        assert flight.plans
        assert not flight.steps["is_given"].any()
        answers = library.answers(flight)
        assert len(differing(answers, log)) == 0
        is_planned = (answers["reason"] == REHEARSED).all(axis=1)
        num_planned += np.count_nonzero(answers["force_n"][is_planned])
        many = fly_all(SHORT, program.controller, [start])
        assert many.delta_v_m_s[0] == log.delta_v_m_s[-1]
    assert num_planned > 3


#: what a mission has besides; by day every third, the night alone compiles for a chief of another shape
KINDS = {
    "a turning chief, an ellipse and errors": {**TURNING, **ELLIPSE, **ERRORS},
    "a turning chief": TURNING,
    "an ellipse, weak thrusters, shadow and safety layer": {**ELLIPSE, **CAMERA, **WEAK},
    "an ellipse and errors": {**ELLIPSE, **ERRORS},
    "an ellipse": ELLIPSE,
    "an oblate Earth, a shaped chief and errors": {
        **ERRORS,
        "dynamics": TwoBody(j2=1.08e-3),
        "chief": {"shape": "mesh"},
    },
    "errors of thrusters alone": {"actuators": {"kind": "real"}},
    "camera, shadow and errors": {**ERRORS, **CAMERA},
    "weak thrusters, safety layer and errors": {**ERRORS, **WEAK},
    "shaped chief": {"chief": {"shape": "mesh"}},
    "camera and shadow": CAMERA,
    "weak thrusters and safety layer": WEAK,
}


@pytest.mark.parametrize("kind", night.by_day([*KINDS], 3))
def test_a_mission_of_another_kind_is_planned_in_the_same_way(kind, tmp_path):
    flown = mission(duration_s=1200.0, **KINDS[kind])
    program = translate(flown, PLANNING["champion_27_rehearsed"], is_tilted=True)
    library = written(program, tmp_path)
    for start in random_starts(2, seed=3):
        tilted = replace(start, sun_elevation_rad=0.2)
        log = fly_logged(flown, program.controller, tilted)
        answers = library.answers(recorded(program, tilted, log))
        assert len(differing(answers, log)) == 0
        assert (answers["reason"] == REHEARSED).any()


def test_what_follows_a_flight_about_an_oblate_earth_is_planned_by_its_tables(tmp_path):
    flown = mission(duration_s=1200.0, **ERRORS, dynamics=TwoBody(j2=1.08e-3, drag_m_s2=1e-7))
    program = translate(flown, PLANNING["champion_leo_parked"])
    library = written(program, tmp_path)
    for start in random_starts(2, seed=3):
        log = fly_logged(flown, program.controller, start)
        assert len(differing(library.answers(recorded(program, start, log)), log)) == 0
        assert np.count_nonzero(log.foresight_at[1:, 1]) > 0


def rules_flight(program, start):
    """A flight of a program's rules without its plan."""
    rules = finishing(program.controller)
    log = fly_logged(SHORT, rules, start)
    return recorded(replace(program, controller=rules), start, log), log


def plan_at(program, start, state, sample, unseen):
    """The forces of the plan that the product makes from a state at a sample on, (K - sample, 3), N."""
    world = pack_world(SHORT)
    known = replace(SHORT, attitude=replace(SHORT.attitude, mode="ideal"))
    deputies = at_start(SHORT, known, program.controller, [start], 0, 8)
    left = np.zeros((1, world.points.shape[2]), dtype=np.uint8)
    left[0, : len(unseen)] = unseen
    believed = replace(start, position_m=state[:3], velocity_m_s=state[3:])
    ((outlook, needed),) = replace(deputies, sample=sample, believed=[believed], left=left).outlooks()
    num_pushes, words = deputies.num_pushes, state.view(np.uint32).tolist()
    searches = [
        search_pushes(
            *(outlook, num_pushes, needed, deputies.constant("foresight_reach_m_s"), effort),
            np.random.default_rng(np.random.SeedSequence(words, spawn_key=(sample, 0, number))),
        )
        for number, effort in enumerate(first_searches(program.controller))
    ]
    best = min(searches, key=lambda search: search.cost).best
    forces = np.zeros((world.num_controls - sample, 3))
    begins = [0, *(deputies.step * int(gene) for gene in best[3 * num_pushes :])]
    for begin, push in zip(begins, best[: 3 * num_pushes].reshape(-1, 3), strict=True):
        forces[begin] += np.where(np.abs(push) < outlook.least_force, 0.0, push)
    return forces


@pytest.mark.parametrize("lead", [1, 3])
def test_a_plan_is_made_in_flight_from_where_the_deputy_will_be(planning, lead):
    program, library = planning
    (start,) = random_starts(1, seed=9)
    flight, log = rules_flight(program, start)
    planner = program.planner
    efforts = first_searches(program.controller)
    num_searched = sum(effort.num_priced // planner.num_tried for effort in efforts)
    library.start(flight.start)
    library._functions.set_lead(library._state, lead)
    outputs = np.zeros(len(flight.steps), OUTPUT)
    budget = -(-num_searched // lead)
    for k in range(len(flight.steps)):
        library.step(flight.steps[k : k + 1], outputs[k : k + 1])
        left = library.plan(budget)
        assert left == max(0, num_searched - budget * (k + 1))
    np.testing.assert_array_equal(outputs["force_n"][:lead], log.force_commanded_n[:lead])
    state = np.r_[start.position_m, start.velocity_m_s]
    predict(pack_world(SHORT), state, Three(*outputs["force_n"][0].tolist()), 0, lead)
    np.testing.assert_allclose(state[:3], log.position_m[lead], rtol=0, atol=1e-9)
    expected = plan_at(program, start, state, lead, flight.steps["unseen"][0])
    last = np.flatnonzero(expected.any(axis=1))[-1]
    np.testing.assert_array_equal(outputs["force_n"][lead : lead + last + 1], expected[: last + 1])
    assert (outputs["reason"][lead : lead + last + 1] == REHEARSED).all()
    assert (outputs["reason"][lead + last + 1 :] != REHEARSED).all()


def test_a_call_tries_no_more_than_a_part_of_a_generation(planning):
    """However many plans a generation has: a call must fit between two steps."""
    program, library = planning
    (start,) = random_starts(1, seed=2)
    flight, _ = rules_flight(program, start)
    library.start(flight.start)
    library.plan_from(flight.steps[:1])
    planner, num_left = program.planner, library.plan(0)
    assert planner.num_plans % planner.num_tried == 0
    assert planner.num_tried <= MOST_TRIED
    assert num_left * planner.num_tried == planner.num_plans * planner.num_generations * planner.num_searches
    assert [library.plan(1) for _ in range(num_left)] == list(range(num_left))[::-1]


@pytest.mark.parametrize(("num_plans", "count"), [(6, 3), (8, 4), (12, 4), (32, 4), (64, 4), (17, 1)])
def test_all_parts_of_a_generation_are_alike(num_plans, count):
    assert num_tried(num_plans) == count


def assert_names_are_of_the_c(program):
    code, option = sources(program).code, joined(program)
    names = re.findall(r"(\w+):0", option)
    assert option == f"-eva-slevel-function {','.join(f'{name}:0' for name in names)} "
    assert set(names) - {"main"} <= set(re.findall(r"(\w+)\(.*\)\n{", code))
    assert {"select_cheaper", "price_up_to"} < set(names)
    assert not {"infer", "decide", "controller_step"} & set(names)
    assert joined(replace(program, planner=None)) == ""


def assert_each_function_is_written_once(program):
    code, bodies = sources(program).code, {}
    for kind, name, numbers, body in re.findall(
        r"^static (\w[\w ]*?)(\w+)\(([^)]*)\)\n\{\n(.*?)^\}", code, re.MULTILINE | re.DOTALL
    ):
        bodies.setdefault((kind, numbers, body), []).append(name)
    assert len(bodies) > 30
    assert [names for names in bodies.values() if len(names) > 1] == []


def test_a_function_that_is_called_in_several_ways_is_written_once(planning):
    assert_each_function_is_written_once(planning[0])


def test_a_function_of_flights_ahead_is_written_once(replanning):
    assert_each_function_is_written_once(replanning[0])


def test_the_analyser_takes_ways_together_in_functions_that_the_c_has(planning):
    """It refuses an option for a function that is not there, and takes ways apart in those of the rules."""
    assert_names_are_of_the_c(planning[0])


def test_the_analyser_takes_ways_together_in_functions_of_flights_ahead(replanning):
    assert_names_are_of_the_c(replanning[0])


def test_the_header_names_the_controller_as_it_ships(planning):
    program, _ = planning
    name = program.controller.name
    assert sources(program).identity["controller"] == content_hash(PLANNING[name].fuzzy)


def test_rules_fly_while_no_plan_is_ready_in_time(planning):
    program, library = planning
    (start,) = random_starts(1, seed=9)
    flight, log = rules_flight(program, start)
    library.start(flight.start)
    outputs = np.zeros(len(flight.steps), OUTPUT)
    for k in range(len(flight.steps)):
        library.step(flight.steps[k : k + 1], outputs[k : k + 1])
        library.plan(1)
    assert len(differing(outputs, log)) == 0


def test_a_plan_goes_on_without_what_it_does_not_need(planning):
    program, library = planning
    (start,) = random_starts(1, seed=7)
    flight = recorded(program, start, fly_logged(SHORT, program.controller, start))
    lost = flight.steps.copy()
    lost["sun_angle"][1:], lost["attitude"][1:], lost["age_points"][1:] = np.nan, 0.0, 99
    well, answers = library.answers(flight), library.answers(flight._replace(steps=lost))
    is_planned = well["mode"] == list(MODES).index("PLAN")
    np.testing.assert_array_equal(answers["force_n"][is_planned], well["force_n"][is_planned])
    np.testing.assert_array_equal(answers["mode"] == list(MODES).index("PLAN"), is_planned)
    assert np.any(answers["force_n"][1:])
    assert not np.any(answers["force_n"][1:][~is_planned[1:]])


def test_nothing_is_planned_before_the_start_or_from_bad_input(planning):
    program, library = planning
    (start,) = random_starts(1, seed=2)
    flight, _ = rules_flight(program, start)
    library._state[:] = [0.0] * len(library._state)
    assert library.plan() == 0
    assert library.plan_from(flight.steps[:1]) == BAD_START
    library.start(flight.start)
    assert library.plan() == 0
    bad = flight.steps[:1].copy()
    bad["position_m"] = np.nan
    assert library.plan_from(bad) == BAD_POSITION
    bad = flight.steps[:1].copy()
    bad["sun_angle"] = -bad["sun_angle"]  # whose light the search has is that of the start's
    assert library.plan_from(bad) == START_BITS["START_SUN"][0]
    assert library.plan(0) == 0
    assert library.plan_from(flight.steps[:1]) == 0
    assert library.plan(0) > library.plan(1) > library.plan(2) > 0
    assert library.plan() == 0


@pytest.fixture(scope="module", params=night.by_day([*PLANNING], 2))
def replanning(request, tmp_path_factory):
    program = translate(NOISY, PLANNING[request.param])
    return program, written(program, tmp_path_factory.mktemp("replanning"))


def test_c_plans_again_from_the_estimate_as_the_product_does(replanning):
    program, library = replanning
    num_anew = num_held = num_coasted = 0
    starts = random_starts(6, seed=11)
    together = fly_all(NOISY, program.controller, starts).delta_v_m_s
    for start, delta_v in zip(starts, together, strict=True):
        log = fly_logged(NOISY, program.controller, start)
        assert len(log.foresight_at) == NOISY.num_controls // program.planner.again.period
        assert len(differing(library.answers(recorded(program, start, log)), log)) == 0
        assert delta_v == log.delta_v_m_s[-1]
        later = log.foresight_at[:, 0] > 0
        num_held += np.count_nonzero(later & (log.foresight_at[:, 1] == 0))
        num_anew += np.count_nonzero(later & (log.foresight_at[:, 1] > 0))
        num_coasted += np.count_nonzero(log.foresight_ends_m_s[:, 0] <= log.foresight_ends_m_s[:, 1])
    assert num_anew > 3
    if not program.planner.has_tail:  # what errors lead to long after a flight is seldom still as planned
        assert num_held > 0
    assert num_coasted > 0


def test_the_last_plan_is_flown_on_where_another_is_not_ready_in_time(replanning):
    program, library = replanning
    (start,) = random_starts(1, seed=11)
    flight = recorded(program, start, fly_logged(NOISY, program.controller, start))
    period = program.planner.again.period

    def flown(budget):
        outputs = np.zeros(len(flight.steps), OUTPUT)
        library.start(flight.start)
        library.plan_from(flight.steps[:1])
        library.plan()
        for k in range(len(outputs)):
            library.step(flight.steps[k : k + 1], outputs[k : k + 1])
            library.plan(budget if k < len(outputs) // 2 else 1 << 20)
        return outputs

    in_time, late = flown(1 << 20), flown(1)
    np.testing.assert_array_equal(late["force_n"][:period], in_time["force_n"][:period])
    never = np.zeros(len(flight.steps), OUTPUT)
    library.start(flight.start)
    library.plan_from(flight.steps[:1])
    library.plan()
    for k in range(len(never)):
        library.step(flight.steps[k : k + 1], never[k : k + 1])
    half = len(never) // 2
    np.testing.assert_array_equal(late["force_n"][:half], never["force_n"][:half])


@pytest.mark.parametrize("lead", [2, 3])
def test_a_later_plan_begins_where_the_one_that_is_flown_leads(replanning, lead):
    """With more periods to search in, also the forces that it still fires move the deputy."""
    program, library = replanning
    (start,) = random_starts(1, seed=11)
    flight = recorded(program, start, fly_logged(NOISY, program.controller, start))
    period, outputs = program.planner.again.period, np.zeros(len(flight.steps), OUTPUT)
    library.start(flight.start)
    library._functions.set_lead(library._state, lead)
    library.plan_from(flight.steps[:1])
    library.plan()
    for k in range(period):
        library.step(flight.steps[k : k + 1], outputs[k : k + 1])
        if k == period - lead:
            library.plan(0)
            break
    state = np.r_[flight.steps["position_m"][k], flight.steps["velocity_m_s"][k]]
    forces = [outputs["force_n"][k]]
    for later in range(k + 1, period):
        library.step(flight.steps[later : later + 1], outputs[later : later + 1])
        forces.append(outputs["force_n"][later] * (outputs["reason"][later] == REHEARSED).all())
    for force in forces:
        predict(pack_world(NOISY), state, Three(*force.tolist()), 0, 1)
    planned = np.zeros(6)
    library._functions.read_plan(library._state, planned.ctypes.data_as(ctypes.c_void_p))
    np.testing.assert_array_equal(planned, state)


def test_the_last_plan_is_flown_on_without_a_covariance(replanning):
    program, library = replanning
    (start,) = random_starts(1, seed=11)
    flight = recorded(program, start, fly_logged(NOISY, program.controller, start))
    lost = flight.steps.copy()
    lost["covariance"][1:, 7] = np.nan
    answers, outputs = library.answers(flight._replace(steps=lost)), np.zeros(len(lost), OUTPUT)
    library.start(flight.start)
    library.plan_from(flight.steps[:1])
    library.plan()
    for k in range(len(lost)):
        library.step(flight.steps[k : k + 1], outputs[k : k + 1])
    np.testing.assert_array_equal(answers["force_n"], outputs["force_n"])
    np.testing.assert_array_equal(answers["mode"], outputs["mode"])
    assert (answers["status"][1:] == FIELD_BITS["BAD_COVARIANCE"]).all()
    library.start(flight.start)
    assert library.plan_from(lost[1:2]) == FIELD_BITS["BAD_COVARIANCE"]
    assert library.plan(0) == 0


@pytest.mark.parametrize("name", ["champion_27_rehearsed", "champion_27_parked"])
def test_an_export_that_plans_again_repeats_its_flights_by_its_own_evidence(name, tmp_path):
    program, folder = translate(NOISY, PLANNING[name]), tmp_path / "flight_software"
    result = export(program, random_starts(1, seed=11), folder)
    assert (result.num_different, result.num_commands) == (0, NOISY.num_controls)
    evidence, compiled = folder / "evidence", tmp_path / "compared"
    files = [evidence / "main.c", evidence / "vector.c", folder / "controller.c", folder / "packets.c"]
    command = ["gcc", "-std=c99", "-O1", "-ffp-contract=off", *WARNINGS, "-o", compiled, *files, "-lm"]
    subprocess.run(command, check=True, timeout=300)  # noqa: S603
    printed = subprocess.run([compiled], check=True, timeout=300, capture_output=True, text=True)  # noqa: S603
    assert printed.stdout == f"1 flights, {NOISY.num_controls} control periods: 0 commands differ\n"
    analysed = ["gcc", "-std=c99", *WARNINGS, "-fsyntax-only", evidence / "any_input.c"]
    subprocess.run(analysed, check=True, timeout=300)  # noqa: S603
    assert "BAD_COVARIANCE" in (folder / "interface.md").read_text(encoding="utf-8")


def test_flights_ahead_leave_what_the_rules_go_on_with(replanning):
    """Between two steps, however far they have come."""
    program, library = replanning
    planner, again = program.planner, program.planner.again
    num_parts = again.num_generations * again.num_searches * (planner.num_plans // planner.num_tried)
    # a search and flights ahead that begin two periods before the plan end in the second one
    half, left = -(-(num_parts + planner.num_flown) // 2), []

    def flown(flight, budget):
        outputs = np.zeros(len(flight.steps), OUTPUT)
        library.start(flight.start)
        library._functions.set_lead(library._state, 2)
        library.plan_from(flight.steps[:1])
        library.plan()
        for k in range(len(outputs)):
            library.step(flight.steps[k : k + 1], outputs[k : k + 1])
            left.append(library.plan(budget))
        return outputs

    for start in random_starts(4, seed=11):
        flight = recorded(program, start, fly_logged(NOISY, program.controller, start))
        outputs, at_once = flown(flight, half), flown(flight, 1 << 20)
        np.testing.assert_array_equal(outputs["force_n"], at_once["force_n"])
        np.testing.assert_array_equal(outputs["reason"], at_once["reason"])
    assert any(left)


def test_clusters_do_not_matter_to_rules_that_sense_no_target():
    code, among_clusters = (
        sources(
            translate(
                mission(duration_s=1200.0, **ERRORS, guidance={"kind": kind}),
                PLANNING["champion_27_rehearsed"],
            )
        ).code
        for kind in ("centroid", "clusters")
    )
    assert among_clusters == code


def test_thrusters_that_turn_the_deputy_are_flown_ahead_without_turning_it(tmp_path):
    turned = {**ERRORS, "actuators": {"kind": "real", "thrust_arm_m": 0.1}}
    flown = mission(duration_s=1200.0, **turned)
    program = translate(flown, PLANNING["champion_27_rehearsed"])
    (start,) = random_starts(1, seed=5)
    log = fly_logged(flown, program.controller, start)
    assert len(differing(written(program, tmp_path).answers(recorded(program, start, log)), log)) == 0
