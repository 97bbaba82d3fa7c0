"""First pushes and images of tours chosen by flying the rules ahead, against flights with each of them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.array_types import Floats
from pipeline.command_line.config import compose_experiment
from pipeline.flight.cases.navigation import FIXES
from pipeline.flight.cases.starts import cases_of
from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy
from pipeline.flight.control.law import law_of, rehearsed_pushes
from pipeline.flight.fly.population import fly_population
from pipeline.flight.fly.rehearsals import rehearsed_openings
from pipeline.flight.fly.simulation import fly_all, fly_logged
from pipeline.flight.fly.tours import IMAGES, following, rehearsal_samples, tour_images, tour_names
from pipeline.flight.reference.tour import tour_position
from pipeline.flight.state.log import Outcomes, Scenario
from pipeline.flight.state.signals import CONSTANTS, TOUR_COEFFICIENTS, constant
from pipeline.flight.world.pack import pack_world
from pipeline.settings.experiment import Mission
from pipeline.training.genome import genome_of
from pipeline.training.judging import fitness_from
from tests.pipeline.flight import cases
from tests.pipeline.flight.as_written import assert_as_written
from tests.pipeline.flight.cases import SEEING, STARTS, mission, random_starts, touring, with_attributes

pytestmark = pytest.mark.slow

MISSION = mission(attitude={"mode": "ideal"})


def rehearsing(reach_m_s: float, **changes: str) -> Controller:
    return with_attributes(SEEING, rehearsal_reach_m_s=repr(reach_m_s), **changes)


def costs(end: Outcomes, needed: Any, point_m_s: float = 0.15) -> Floats:
    """What ends of flights are told apart by, m/s."""
    short = point_m_s * np.maximum(0, needed - end.inspected_count)
    return end.delta_v_m_s + short + 1e4 * end.is_violated.astype(np.float64)


def constants_of(controller: Controller) -> dict[str, float]:
    return dict(zip(CONSTANTS, controller.constants.tolist(), strict=True))


def test_the_pushes_are_a_grid_with_none_first() -> None:
    assert rehearsed_pushes(SEEING).shape == (0, 3)
    pushes = rehearsed_pushes(rehearsing(0.12))
    assert not pushes[0].any()
    assert len(np.unique(pushes.round(12), axis=0)) == len(pushes) == 105
    np.testing.assert_allclose(np.abs(pushes).max(axis=0), [0.12, 0.06, 0.03])
    np.testing.assert_allclose(pushes.sum(axis=0), 0.0, atol=1e-12)


def test_the_push_that_ends_cheapest_is_fired_and_the_rules_go_on() -> None:
    controller = rehearsing(0.12)
    forces = rehearsed_pushes(controller) * 12.0 / 10.0
    flown = fly_all(MISSION, controller, STARTS)
    world, law, numbers = pack_world(MISSION), law_of(SEEING, MISSION), SEEING.numbers
    openings = [np.tile([*force, 1.0], (len(STARTS), 1, 1)) for force in forces]
    drawn = cases_of(MISSION, STARTS)
    ends = [fly_population(world, law, numbers, drawn, 1, openings=each) for each in openings]
    # two points missed cost nothing, as the controller puts up with them
    cost = np.array([costs(end, 97)[0] for end in ends])
    for case, start in enumerate(STARTS):
        best = int(np.argmin(cost[:, case]))
        assert flown.delta_v_m_s[case] == ends[best].delta_v_m_s[0, case]
        assert flown.inspected_count[case] == ends[best].inspected_count[0, case]
        log = fly_logged(MISSION, controller, start)
        np.testing.assert_array_equal(log.force_hill_n[0], forces[best])
        np.testing.assert_allclose(log.push_costs_m_s, cost[:, case], rtol=0, atol=1e-9)
        assert not log.is_decided[0]
    assert_as_written(replace(MISSION, duration_s=300.0), controller, STARTS[0])


INITIAL = {"initial_position_m": 20.0, "initial_velocity_m_s": 0.01}
REAL = mission(attitude={"mode": "ideal"}, navigation={"mode": "fixes"} | INITIAL, actuators={"kind": "real"})
NOISY = replace(STARTS[0], noise=(1, 2, 3))


def off_at_start(start: Scenario) -> Floats:
    """The first of what is drawn: how far off the first estimate is."""
    return np.repeat(list(INITIAL.values()), 3) * start.generator(FIXES).standard_normal(6)


def moved(by: Floats, noise: tuple[int, int, int]) -> Scenario:
    """The start elsewhere, with other noise."""
    position, velocity = NOISY.position_m + by[:3], NOISY.velocity_m_s + by[3:]
    return replace(NOISY, position_m=position, velocity_m_s=velocity, noise=noise)


def test_it_is_rehearsed_without_the_errors_to_come() -> None:
    believed = moved(off_at_start(NOISY), NOISY.noise)
    flights = (REAL, NOISY), (MISSION, believed), (MISSION, NOISY)
    openings = [rehearsed_openings(what, rehearsing(0.12), [at], 1)[0] for what, at in flights]
    np.testing.assert_array_equal(openings[0], openings[1])
    assert np.any(openings[0] != openings[2])


def test_it_is_along_hills_axes_and_a_tour_has_two_or_four_images() -> None:
    with pytest.raises(ControllerError, match="set the attribute force_axes to hill"):
        rehearsing(0.1, force_axes="body")
    with pytest.raises(ControllerError, match="rehearsal_tours '3'; give 2"):
        touring(rehearsal_tours=3)


@pytest.mark.parametrize("image", range(4))
def test_an_image_of_a_tour_is_its_mirror_image(image: int) -> None:
    images = tour_images(touring(rehearsal_tours=4))
    tour, reflected = constants_of(images[0]), constants_of(images[image])
    # the other way round, the Sun comes to every angle from the other side; below the plane it was above it
    round_way, up = (-1.0 if image >= 2 else 1.0), (-1.0 if image % 2 else 1.0)
    for angle in np.linspace(-3.0, 3.0, 7):
        there = np.array([1.0, round_way, up]) * tour_position(tour, round_way * angle, up * 0.4)
        np.testing.assert_allclose(tour_position(reflected, angle, 0.4), there, atol=1e-12)


@pytest.mark.parametrize("count", [2, 4])
def test_the_image_that_ends_cheapest_is_followed(count: int) -> None:
    controller, starts = touring(rehearsal_tours=count), random_starts(6, seed=1)
    images = tour_images(controller)
    assert len(images) == count <= len(IMAGES)
    assert constants_of(images[0]) == constants_of(controller) | {"rehearsal_tours": 0.0}
    ends = [fly_all(MISSION, image, starts) for image in images]
    cost = [costs(end, 99) for end in ends]  # every point is asked for
    best = np.argmin(cost, axis=0)
    tracks = np.empty((len(starts), MISSION.num_controls + 1, 3), dtype=np.float32)
    flown = fly_all(MISSION, controller, starts, tracks=tracks)
    cheapest = [ends[image].delta_v_m_s[case] for case, image in enumerate(best)]
    np.testing.assert_array_equal(flown.delta_v_m_s, cheapest)
    assert len(set(best.tolist())) > 1
    log = fly_logged(MISSION, controller, starts[-1])
    assert log.delta_v_m_s[-1] == flown.delta_v_m_s[-1]
    np.testing.assert_allclose(log.tour_costs_m_s[0], np.array(cost)[:, -1], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(tracks[-1], log.position_m.astype(np.float32))


def test_training_flies_the_images_ahead_as_well() -> None:
    overrides = ["+experiment=train_readable", "optimizer=tour", "attitude=ideal", "optimizer.workers=1"]
    experiment = compose_experiment(overrides).experiment
    genome = genome_of(touring(rehearsal_tours=4), experiment.optimizer.encoding)
    starts = random_starts(4, seed=1)
    genomes = np.array([genome.encode(), 0.9 * genome.encode() + 0.05])
    judged = fitness_from(experiment, genome, starts, 0)(genomes)["delta_v_m_s"]
    controllers = [from_fuzzy(genome.decode(individual)) for individual in genomes]
    flown = [fly_all(experiment.mission, individual, starts).delta_v_m_s.mean() for individual in controllers]
    np.testing.assert_array_equal(judged, flown)
    assert judged[0] != judged[1]


def test_tours_are_flown_ahead_in_times_and_sizes() -> None:
    controller = touring(rehearsal_tours=2, rehearsal_slowest_s=1200.0, rehearsal_smallest=0.5)
    images, names = tour_images(controller), tour_names(controller)
    assert len(images) == len(set(names)) == 2 * 3 * 2
    assert constants_of(images[0]) == constants_of(controller) | {"rehearsal_tours": 0.0}
    first, last = constants_of(images[0]), constants_of(images[-1])
    assert names[-1] == "mirrored through the orbit plane, 50 % of its size, in 1200 s"
    assert last["tour_time_s"] == pytest.approx(1200.0)
    np.testing.assert_allclose(
        tour_position(last, 0.7, 0.4), tour_position(first, 0.7, -0.4) * [0.5, 0.5, -0.5]
    )
    times = sorted({image.constants[constant("tour_time_s")] for image in images})
    ratios = np.divide(times[1:], times[:-1])
    np.testing.assert_allclose(ratios, (1200.0 / first["tour_time_s"]) ** (1 / 2))


def test_other_shapes_are_drawn_around_the_tour() -> None:
    controller = touring(rehearsal_tours=2, rehearsal_shapes=200.0, rehearsal_spread_m=8.0)
    images, names = tour_images(controller), tour_names(controller)
    assert len(images) == len(set(names)) == 2 * 201
    assert constants_of(images[0]) == constants_of(controller) | {"rehearsal_tours": 0.0}
    assert names[2:4] == ["shape 1, as it is", "shape 1, mirrored through the orbit plane"]
    columns = list(map(constant, TOUR_COEFFICIENTS))
    off = np.array([image.constants - images[0].constants for image in images[2::2]])
    assert not np.delete(off, columns, axis=1).any()
    # 4,000 normal numbers: their spread is known to one part in ninety
    assert off[:, columns].std() == pytest.approx(8.0, rel=0.04)
    assert abs(off[:, columns].mean()) < 0.5
    again = tour_images(touring(rehearsal_tours=2, rehearsal_shapes=1.0, rehearsal_spread_m=8.0))
    assert again[2].constants[columns].tolist() == images[2].constants[columns].tolist()


def test_a_tour_that_is_followed_from_later_on_is_flown_as_written() -> None:
    controller = touring(rehearsal_tours=4, rehearsal_period_s=100.0)
    short = replace(MISSION, duration_s=400.0)
    assert rehearsal_samples(controller, short) == [0, 10, 20, 30]
    relay = following(controller, short, [0, 3, 1, 0])
    log = assert_as_written(short, relay, STARTS[0])
    alone = fly_logged(short, tour_images(controller)[0], STARTS[0])
    np.testing.assert_array_equal(log.force_hill_n[:10], alone.force_hill_n[:10])
    assert np.any(log.force_hill_n[10] != alone.force_hill_n[10])


@pytest.mark.parametrize("delay_s", [None, 20.0])
def test_tours_are_flown_ahead_again_from_where_the_deputy_believes_to_be(delay_s: float | None) -> None:
    """Without errors a later rehearsal tells what following each tour from then on costs, to the end."""
    known = {}
    if delay_s is not None:
        small = {"noise_m": 1e-6, "initial_position_m": 1e-6, "initial_velocity_m_s": 1e-9}
        known["navigation"] = {"mode": "fixes", "delay_s": delay_s, **small}
    exact = mission(attitude={"mode": "ideal"}, **known)
    controller = touring(rehearsal_tours=4, rehearsal_period_s=1200.0)
    start, at = random_starts(6, seed=1)[-1], [0, 120, 240]
    least, most = exact.deputy.min_distance_m, exact.deputy.max_distance_m
    log = fly_logged(exact, controller, start)
    assert rehearsal_samples(controller, exact) == at
    assert log.tour_costs_m_s.shape == (3, 4)
    followed = log.tour_costs_m_s.argmin(axis=1).tolist()
    for rehearsal, sample in enumerate(at):
        for tour in range(4):
            end = fly_logged(exact, following(controller, exact, [*followed[:rehearsal], tour]), start)
            missed = 0.15 * np.count_nonzero(~end.is_inspected[-1])
            spent = end.delta_v_m_s[-1] - end.delta_v_m_s[sample]
            distance = np.linalg.norm(end.position_m[sample + 1 :], axis=1)
            is_outside = np.any((distance < least) | (distance > most))
            cost = spent + missed + 1e4 * is_outside
            assert log.tour_costs_m_s[rehearsal, tour] == pytest.approx(cost, abs=1e-5)
    relay = fly_logged(exact, following(controller, exact, followed), start)
    np.testing.assert_array_equal(log.position_m, relay.position_m)
    flown = fly_all(exact, controller, random_starts(6, seed=1))
    assert flown.delta_v_m_s[-1] == log.delta_v_m_s[-1]


def test_a_flight_that_begins_at_a_later_sample_is_that_of_a_shorter_mission() -> None:
    """Where light is all that depends on time, for a controller that follows its tour whatever it sees."""
    sighting = {
        "measures": "range_bearing",
        "delay_s": 20.0,
        "attitude_bias_deg": 0.5,
        "attitude_noise_deg": 0.1,
    }
    real = mission(
        attitude={"mode": "ideal"},
        navigation={"mode": "fixes", "fix_period_s": 30.0, **sighting},
        actuators={"kind": "real", "delay_s": 20.0, "scale_error": 0.05},
    )
    attributes = {name: float(text) for name, text in cases.TOURING.fuzzy.attributes if name != "force_axes"}
    touring_alone = cases.leaning(cases.along_each({"tour_push": 0.2}), attributes | {"tour_lean_m": 0.0})
    first, seconds = 60, 600.0
    rest = replace(real, duration_s=real.duration_s - seconds)
    turned = real.orbit.mean_motion_rad_s * seconds
    starts = [replace(start, noise=(1, 2, case)) for case, start in enumerate(random_starts(3, seed=2))]
    late = [replace(start, sun_angle_rad=start.sun_angle_rad - turned) for start in starts]
    drawn, shorter = cases_of(real, starts), cases_of(rest, late)
    # contiguous, as all code is compiled for
    errors = drawn.fixes.errors._replace(
        of_fixes=drawn.fixes.errors.of_fixes[:, first // 3 :].copy(),
        of_sight=drawn.fixes.errors.of_sight[:, first // 3 :].copy(),
        of_attitude=drawn.fixes.errors.of_attitude[:, first:].copy(),
    )
    shorter = replace(shorter, fixes=shorter.fixes._replace(errors=errors), firing=drawn.firing)
    tracks = [np.zeros((3, each.num_controls + 1, 15), dtype=np.float32) for each in (real, rest)]
    worlds = pack_world(real)._replace(first=first), pack_world(rest)
    for world, each, flown, track in zip(worlds, (real, rest), (drawn, shorter), tracks, strict=True):
        law, numbers = law_of(touring_alone, each), touring_alone.numbers
        fly_population(world, law, numbers, flown, 1, tracks=track)
    np.testing.assert_allclose(tracks[0][:, first:, :6], tracks[1][:, :, :6], rtol=1e-5, atol=1e-5)
    assert np.ptp(tracks[1][:, :, 6]) > 0.1


def test_times_of_rehearsals_are_those_of_decisions() -> None:
    controller = touring(rehearsal_tours=2, rehearsal_period_s=90.0, decision_period_s=60.0)
    with pytest.raises(ControllerError, match="rehearsal_period_s 90; give a multiple of the 60 s from one"):
        fly_logged(MISSION, controller, STARTS[0])


def test_draws_of_the_errors_go_to_the_tour_that_is_cheapest_so_far() -> None:
    controller = touring(rehearsal_tours=4, rehearsal_draws=20, rehearsal_point_m_s=0.3)

    def cost(image: Controller, flown: Mission, at: Scenario) -> float:
        end = fly_all(flown, image, [at], 1)
        return float(costs(end, end.inspectable_count, 0.3)[0])

    belief = off_at_start(NOISY)
    images = tour_images(controller)
    flights = [[cost(image, MISSION, moved(belief, NOISY.noise))] for image in images]
    for count in (16, 4):
        best = int(np.argmin([np.mean(costs) for costs in flights]))
        for _ in range(count):
            noise = (1, 2 + (len(flights[best]) << 22), 3)
            off = off_at_start(replace(NOISY, noise=noise))
            flights[best].append(cost(images[best], REAL, moved(belief - off, noise)))
    wanted = [np.mean(costs) if len(costs) > 1 else np.inf for costs in flights]
    log = fly_logged(REAL, controller, NOISY)
    np.testing.assert_allclose(log.tour_costs_m_s[0], wanted, rtol=0, atol=1e-9)
    many = [replace(NOISY, noise=(1, 2, case)) for case in (3, 4, 5)]
    alone, shared = (fly_all(REAL, controller, many, workers).delta_v_m_s for workers in (1, 2))
    np.testing.assert_array_equal(alone, shared)
    assert log.delta_v_m_s[-1] == alone[0]


@pytest.mark.parametrize("name", ["rehearsal_draws", "rehearsal_shapes"])
def test_draws_and_shapes_are_counted_whole(name: str) -> None:
    with pytest.raises(ControllerError, match=rf"{name} '1\.5'"):
        touring(rehearsal_tours=4, **{name: 1.5})
