"""Many flights judged by formulas, and the search for the worst case."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fis_tools.analysis.flights import read_outcome
from pipeline.command_line.config import compose_experiment
from pipeline.controllers.source import named
from pipeline.evaluation.assurance import campaign
from pipeline.evaluation.assurance.campaign import Campaign, FormulaResult, WorstCaseSearch, evaluate_formulas
from pipeline.evaluation.assurance.case_space import CaseSpace, case_space
from pipeline.evaluation.assurance.formula import FormulaError, parse, render
from pipeline.evaluation.assurance.quantities import QUANTITIES, UNITS, TrackFacts, of_tracks, track_of
from pipeline.evaluation.assurance.requirements import Requirement, RequirementError, load_requirements
from pipeline.flight.cases.dispersions import mission_of_case
from pipeline.flight.control.controller import coast
from pipeline.flight.fly.reference import reference_of
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.reference.two_body import hill_axes
from pipeline.flight.state.arrays import TRACK_BORESIGHT, TRACK_FORCE, TRACK_TURN_RATE
from pipeline.flight.state.log import FlightLog, Scenario
from pipeline.physics.quaternion import dcm_b_from_h
from pipeline.recording.recorder import FlightRecorder
from pipeline.recording.reflight import fly_again
from pipeline.run.engine import HERE, TaskPool
from pipeline.scenarios import DrawnCases, evaluation_scenarios
from pipeline.settings.checks import SettingError
from pipeline.settings.experiment import Mission
from telemetry.file.reader import read as read_recording
from tests.pipeline.evaluation.assurance.cases import champion, experiment, scenarios

REQUIREMENTS = load_requirements("inspection", Mission())
KEEP_OUT = REQUIREMENTS[0]
EXPERIMENT = experiment()
MISSION = EXPERIMENT.mission
FLIGHTS = Campaign(MISSION, champion())
SMALL = replace(EXPERIMENT.assurance, search_starts=8, search_population=5, search_generations=2)
SPACE = case_space(EXPERIMENT)


def test_margins_are_those_of_the_outcomes_and_parts_do_not_matter(monkeypatch: pytest.MonkeyPatch):
    flown = scenarios(40)
    outcomes = fly_all(MISSION, champion(), flown)
    results = FLIGHTS.judge(flown, REQUIREMENTS)
    wanted = {
        "R1": outcomes.min_distance_m - 15.0,
        "R2": 200.0 - outcomes.max_distance_m,
        "R3": 100.0 * outcomes.inspected_count / 99 - 95.0,
        "R4": 5.62 - outcomes.delta_v_m_s,
    }
    assert set(results) == {*wanted, "R5", "R7", "R8"}
    for name, margins in wanted.items():  # tracks are in single precision
        np.testing.assert_allclose(results[name].margins, margins, rtol=0, atol=2e-5)
    np.testing.assert_array_equal(results["R3"].is_met, outcomes.inspected_count >= 95)
    pool, counts = TaskPool(None), []
    monkeypatch.setattr(pool, "run", lambda *work: counts.append(len(work[1])) or HERE.run(*work))
    for name, outcome in FLIGHTS.judge(flown, REQUIREMENTS, pool, part_cases=7).items():
        np.testing.assert_array_equal(outcome.margins, results[name].margins)
    assert counts == [6]  # the engine has them all
    flown_ones = []
    drawn = FLIGHTS.judge(
        DrawnCases(EXPERIMENT, range(40)), REQUIREMENTS, part_cases=7, show=flown_ones.append
    )
    assert flown_ones == [7, 14, 21, 28, 35, 40]
    for name, outcome in drawn.items():
        np.testing.assert_array_equal(outcome.margins, results[name].margins)
    monkeypatch.setattr(campaign, "PART", 3)
    for name, outcome in Campaign(MISSION, champion(), workers=1).judge(flown, REQUIREMENTS).items():
        np.testing.assert_array_equal(outcome.margins, results[name].margins)


def test_a_result_keeps_none_of_what_it_was_computed_from():
    flights = scenarios(3)
    tracks, facts = FLIGHTS.tracks(flights)
    texts = {"plain": "always distance >= 15", "implied": "always (distance <= 50 -> coasting_distance >= 1)"}
    formulas = {name: parse(text, UNITS) for name, text in texts.items()}
    for result in evaluate_formulas(tracks, facts, formulas, MISSION.control_period_s).values():
        for part in (result.margins, result.is_met, result.units, *result.premises.values()):
            assert part.base is None


def test_enough_is_inspected_in_a_low_orbit_where_a_flight_succeeds(tmp_path: Path):
    composed = compose_experiment(["+experiment=assure", "controller=champion_leo", "world=leo"]).experiment
    flown, pilot = evaluation_scenarios(composed)[:150], named("champion_leo", composed.mission)
    outcomes = fly_all(composed.mission, pilot, flown)
    requirements = load_requirements(composed.assurance.requirements, composed.mission)
    is_met = Campaign(composed.mission, pilot).judge(flown, requirements)["R3"].is_met
    np.testing.assert_array_equal(is_met, outcomes.is_success(95.0))
    assert 0 < np.count_nonzero(is_met) < 150
    case = np.flatnonzero(is_met & (outcomes.inspected_count < 95))[0]
    # a review of its recording says so, too
    path, log = tmp_path / "flight.mcap", fly_logged(composed.mission, pilot, flown[case])
    FlightRecorder(composed, pilot, {}).record(path, flown[case], log, "flight")
    assert read_outcome(path).is_success


def tracked(mission: Mission, log: FlightLog):
    """The track of a logged flight, (K+1, 15), in double precision."""
    left = np.count_nonzero(~log.is_inspected, axis=1)
    fired = np.vstack([log.force_hill_n, np.zeros(3)])
    boresights = [dcm_b_from_h(turned).T @ mission.sensor.boresight for turned in log.quaternion_b_from_h]
    turn_rates = np.linalg.norm(log.angular_velocity_b_rad_s, axis=1)
    columns = [log.position_m, log.velocity_m_s, log.delta_v_m_s, left, fired, boresights, turn_rates]
    return np.column_stack(columns)


def recorded(path: Path, mission: Mission, scenario: Scenario, log: FlightLog, config: object = None):
    recorder = FlightRecorder(replace(EXPERIMENT, mission=mission), champion(), config or {})
    recorder.record(path, scenario, log, "flight")
    return read_recording(path)


def test_tracks_are_those_of_logs_and_of_recordings(tmp_path: Path):
    flown = scenarios(3)
    for track, scenario in zip(FLIGHTS.tracks(flown)[0], flown, strict=True):
        log = fly_logged(MISSION, champion(), scenario)
        exact = tracked(MISSION, log)
        # directions and turn rates are computed in another order than the log's
        same = slice(0, TRACK_BORESIGHT)
        np.testing.assert_array_equal(track[:, same], exact[:, same].astype(np.float32))
        np.testing.assert_allclose(track, exact, rtol=2e-7, atol=2e-7)
        assert np.ptp(exact[:, TRACK_TURN_RATE]) > 0.0
        assert np.any(exact[:-1, TRACK_FORCE:TRACK_BORESIGHT])
    recording = recorded(tmp_path / "flight.mcap", MISSION, scenario, log)
    np.testing.assert_array_equal(track_of(recording, MISSION)[0][0], exact)
    for quantity in QUANTITIES.values():
        topic, field = quantity.topic.split(".")
        assert len(recording[topic][field.partition("[")[0]]) >= MISSION.num_controls


def test_a_formula_about_what_is_never_flown_is_refused():
    formula = parse("always[4000:5000] distance > 15", UNITS)
    late = Requirement(*("R9", *["late"] * 6), ("cases",), "", formula, 0.9, 0.9)
    with pytest.raises(RequirementError, match="R9: its part from 4000 to 5000 s says nothing"):
        FLIGHTS.judge(scenarios(1), [late])


FACTS = TrackFacts(10, np.array([8]), MISSION)


def test_a_deputy_that_coasts_comes_as_near_and_goes_as_far_as_scipy_brings_it():
    generator, n = np.random.default_rng(3), FACTS.mean_motion
    states = np.hstack([generator.normal(0.0, 50.0, (30, 3)), generator.normal(0.0, 0.08, (30, 3))])

    def rates(_time, state):
        x, _, z, u, v, w = state
        return [u, v, w, 3.0 * n * n * x + 2.0 * n * v, -2.0 * n * u, -n * n * z]

    for seconds, text in ((2.0 * np.pi / n, "coasting_distance"), (755.0, "coasting_distance[755 s]")):
        times = np.linspace(0.0, seconds, 20_001)
        paths = [
            solve_ivp(rates, times[[0, -1]], s, "DOP853", times, rtol=1e-11, atol=1e-11).y for s in states
        ]
        distances = [np.linalg.norm(path[:3], axis=0) for path in paths]
        far = text.replace("distance", "farthest")
        formula = {
            "all": parse(f"always ({text} >= 15 m)", UNITS),
            "far": parse(f"always ({far} <= 200 m)", UNITS),
        }
        track = np.pad(states, ((0, 0), (0, 9)))[np.newaxis]
        margins = [evaluate_formulas(track[:, [k]], FACTS, formula, 10.0) for k in range(30)]
        near, away = ([each[name].margins[0] for each in margins] for name in ("all", "far"))
        np.testing.assert_allclose(near, [path.min() - 15.0 for path in distances], rtol=0.0, atol=2e-3)
        np.testing.assert_allclose(away, [200.0 - path.max() for path in distances], rtol=1e-4, atol=2e-3)
    assert render(formula["all"], UNITS) == "always coasting_distance[755] >= 15 m"
    assert parse(render(formula["all"], UNITS), UNITS) == formula["all"]
    with pytest.raises(FormulaError, match="looks ahead by more than 0 s and up to 86400 s"):
        parse("always (coasting_distance[1e6] >= 15)", UNITS)


def test_beside_an_ellipse_it_is_as_scipy_brings_both_craft_about_the_earth():
    ellipse = "orbit=elements", "orbit.semi_major_axis_m=24478137", "orbit.eccentricity=0.725"
    beside = *ellipse, "orbit.true_anomaly_deg=320", "dynamics=two_body", "dynamics.j2=1.08262668e-3"
    mission = compose_experiment(
        ["+experiment=evaluate", "controller=coast", "duration_s=600", *beside]
    ).experiment.mission
    flight, generator = reference_of(mission, coast(), scenarios(1)[0]), np.random.default_rng(4)
    states = np.hstack([generator.normal(0.0, 50.0, (61, 3)), generator.normal(0.0, 0.05, (61, 3))])
    track = np.pad(states, ((0, 0), (0, 9)))[np.newaxis]
    names = "coasting_distance[1200]", "coasting_farthest[1200]"
    near, far = of_tracks(track, TrackFacts(10, np.array([8]), mission), names).values()
    for k in (0, 25, 60):
        chief, (axes, turning) = flight.orbit[k], hill_axes(flight.earth, flight.orbit[k])
        away = states[k, :3] @ axes
        deputy = chief + np.concatenate([away, states[k, 3:] @ axes + np.cross(turning, away)])

        def rates(_time, both):
            pulls = [flight.earth.attraction(position) for position in (both[:3], both[6:9])]
            return np.concatenate([both[3:6], pulls[0], both[9:], pulls[1]])

        path = solve_ivp(
            rates, (0.0, 1200.0), np.r_[chief, deputy], "DOP853", np.arange(1201.0), rtol=1e-12, atol=1e-9
        ).y
        distances = np.linalg.norm(path[6:9] - path[:3], axis=0)
        # it leaves the second order of the attraction out
        np.testing.assert_allclose([near[0, k], far[0, k]], [distances.min(), distances.max()], atol=0.05)


def test_quantities_of_a_flight_by_hand():
    """Two samples: 3-4-0 m at 0-0-2 m/s, then a point more seen of ten and 0.5 m/s spent by 0-0.3-0.4 N.

    The camera looks along the track, then at the chief; the deputy turns by 9 degrees a second, then rests.
    """
    moved = [[3.0, 4.0, 0.0, 0.0, 0.0, 2.0, 0.0, 10.0], [6.0, 8.0, 0.0, 1.0, 0.0, 0.0, 0.5, 9.0]]
    fired, looks = [[0.0, 0.3, -0.4], [0.0, 0.0, 0.0]], [[0.0, 1.0, 0.0], [-0.6, -0.8, 0.0]]
    track = np.hstack([moved, fired, looks, [[np.pi / 20], [0.0]]])[np.newaxis]
    margins = {
        "always (distance >= 4 m)": 1.0,
        "eventually (inspection_rate >= 4 %)": 6.0,
        "eventually (inspectable_rate >= 4 %)": 8.5,
        "always (delta_v <= 0.7 m/s)": 0.2,
        "always (speed <= 3 m/s)": 1.0,
        "eventually (position_along_track >= 6 m and velocity_radial >= 0.5 m/s)": 0.5,
        "always (force <= 0.6 N)": 0.1,
        "eventually (force_cross_track < -0.1 N)": 0.3,
        "always (turn_rate <= 10 deg/s)": 1.0,
        "eventually (pointing_error < 5 deg)": 5.0,
        "pointing_error <= 180 deg": np.degrees(np.arccos(0.8)),
    }
    formulas = {text: parse(text, UNITS) for text in margins}
    computed = {
        name: result.margins[0] for name, result in evaluate_formulas(track, FACTS, formulas, 10.0).items()
    }
    assert computed == pytest.approx(margins)


@pytest.mark.parametrize("problem", ["inspection", "docking", "docking_planar"])
def test_genes_spread_evenly_give_starts_as_an_evaluation_draws_them(problem):
    """Docking starts move; those of the plane come from a box."""
    assured = ["+experiment=assure", f"problem={problem}", "sun=random", "safety=none"]
    composed = compose_experiment(assured).experiment
    starts = replace(composed.monte_carlo, num_cases=4000, directions="even")
    space = case_space(replace(composed, monte_carlo=starts))
    genes = np.random.default_rng(1).random((4000, len(space.genes)))
    ours = [space.scenario(row) for row in genes]
    theirs = evaluation_scenarios(replace(composed, monte_carlo=starts, seed=3))
    for of in (
        lambda scenario: [*scenario.position_m, *scenario.velocity_m_s],
        lambda scenario: [
            np.linalg.norm(scenario.position_m),
            scenario.sun_angle_rad,
            np.linalg.norm(scenario.velocity_m_s),
        ],
    ):
        first, second = (np.array([of(scenario) for scenario in cases]) for cases in (ours, theirs))
        spread = second.std(axis=0)
        assert np.all(np.abs(first.mean(axis=0) - second.mean(axis=0)) <= 0.1 * spread)
        assert np.all(np.abs(first.std(axis=0) - spread) <= 0.05 * spread)
    assert any(scenario.velocity_m_s.any() for scenario in ours) == (problem != "inspection")


def test_a_fixed_sun_is_not_searched():
    sun = replace(EXPERIMENT.sun, mode="fixed", angle_deg=90.0)
    space = CaseSpace(EXPERIMENT.monte_carlo, sun)
    assert space.genes == ("height", "azimuth", "distance")
    assert space.scenario(np.array([1.0, 0.0, 0.5])).sun_angle_rad == pytest.approx(np.pi / 2)
    np.testing.assert_allclose(space.scenario(np.array([1.0, 0.3, 0.5])).position_m, [0, 0, 75], atol=1e-6)


def test_dispersed_settings_and_the_suns_elevation_are_searched():
    mass = {"kind": "uniform", "low": 11.0, "high": 13.0}
    gain = {"kind": "normal", "mean": 0.06, "std": 0.001}
    dispersions = {"deputy": {"mass_kg": mass}, "attitude": {"proportional_gain": gain}}
    mission = replace(EXPERIMENT.mission, dispersions=dispersions)
    sun = replace(EXPERIMENT.sun, elevation_range_deg=(-30.0, 10.0))
    space = case_space(replace(EXPERIMENT, mission=mission, sun=sun))
    drawn = ("attitude.proportional_gain", "deputy.mass_kg")
    assert space.genes[3:] == ("sun_angle", "sun_elevation", *drawn)
    middle, end = space.scenario(np.full(7, 0.5)), space.scenario(np.ones(7))
    assert np.degrees([middle.sun_elevation_rad, end.sun_elevation_rad]) == pytest.approx([-10.0, 10.0])
    assert middle.settings == pytest.approx((0.06, 12.0))
    assert end.settings == pytest.approx((0.06 + 3.0 * 0.001, 13.0), rel=1e-3)  # three standard deviations
    mission_at_end = mission_of_case(mission, end)
    drawn = mission_at_end.attitude.proportional_gain, mission_at_end.deputy.mass_kg
    assert (*drawn, mission_at_end.dispersions) == (*end.settings, {})
    with pytest.raises(SettingError, match="given 1 settings of its own, but dispersions name 2"):
        mission_of_case(mission, replace(end, settings=(12.0,)))


@pytest.mark.slow
def test_a_case_found_by_a_search_is_flown_again_from_its_recording(tmp_path):
    """Its mass is in no seed: without its own settings it would be flown with another."""
    mass = "+dispersions.deputy.mass_kg={kind:uniform,low:11.0,high:13.0}"
    composed = compose_experiment(["+experiment=assure", "controller=champion_any_sun", "sun=random", mass])
    mission, controller = composed.experiment.mission, champion()
    space = case_space(composed.experiment)
    scenario = space.scenario(np.full(5, 0.9))
    log = fly_logged(mission, controller, scenario)
    recorded(tmp_path / "worst.mcap", mission, scenario, log, composed.config)
    assert fly_again(tmp_path / "worst.mcap").is_equal
    other = fly_logged(mission, controller, replace(scenario, settings=(11.0,)))
    assert not np.array_equal(other.position_m, log.position_m)


def test_a_search_begins_with_its_angles_in_the_middle():
    genes = np.array([0.3, 0.02, 0.7, 0.97])
    centred, moved = SPACE.centred_on(genes)
    np.testing.assert_array_equal(moved, [0.3, 0.5, 0.7, 0.5])
    scenario = SPACE.scenario(genes)
    same = centred.scenario(moved)
    np.testing.assert_allclose(same.position_m, scenario.position_m, rtol=1e-12)
    assert same.sun_angle_rad == pytest.approx(scenario.sun_angle_rad, rel=1e-12)
    beyond = centred.scenario(np.array([0.3, 0.5, 0.7, 0.6]))  # past the end of the turn
    assert beyond.sun_angle_rad == pytest.approx(0.07 * 2.0 * np.pi)


def searched(settings: object, number: int) -> WorstCaseSearch:
    return campaign.search(KEEP_OUT, FLIGHTS, SPACE, replace(EXPERIMENT, assurance=settings), number)


def test_a_search_repeats_and_counts_every_flight():
    first, same, other = (searched(SMALL, number) for number in (0, 0, 1))
    assert len(first.scenarios) == len(first.outcome.margins) == 8 + 3 * 5
    np.testing.assert_array_equal(first.outcome.margins, same.outcome.margins)
    assert not np.array_equal(first.outcome.margins, other.outcome.margins)
    again = FLIGHTS.judge([first.scenarios[first.worst]], [KEEP_OUT])["R1"]
    assert again.margins[0] == first.outcome.margins.min()


def test_speed_counts_flights_until_the_first_failure():
    def search_with(margins):
        margins = np.array(margins, dtype=float)
        return WorstCaseSearch((None,) * len(margins), FormulaResult(margins, margins >= 0))

    random = FormulaResult(np.zeros(300), np.arange(300) >= 3)
    efficiency = campaign.search_efficiency(
        [search_with([1, 1, -1, -1]), search_with([1, 1, 1, 1]), search_with([-1, 1, 1, 1])], random
    )
    assert efficiency.num_found == 2
    assert (efficiency.flights_per_find, efficiency.random_flights_per_find) == (4.0, 100.0)
    assert efficiency.ratio == 25.0
    assert "one flight in 4; at random one in 100: 25.0 times as many" in efficiency.sentence
    assert campaign.search_efficiency([search_with([1])], random).ratio is None


@pytest.mark.slow
def test_known_exits_are_found_faster_than_at_random():
    """At random champion_any_sun comes too near in 69 of 100,000 cases of seed 99, 1 of 1,449."""
    searches = [searched(EXPERIMENT.assurance, number) for number in range(4)]
    random = FLIGHTS.judge(scenarios(1000), [KEEP_OUT])["R1"]
    assert sum(search.first_failed is not None for search in searches) >= 2
    assert min(search.outcome.margins.min() for search in searches) < random.margins.min()
    needed = sum(search.first_failed or len(search.scenarios) for search in searches)
    assert needed / sum(search.first_failed is not None for search in searches) < 1449 / 2
