"""Values that cannot be are refused with the fact, the expectation and the cure.

A key that another setting makes idle does not exist: it is refused, told or passed over, never obeyed.
"""

import math
from dataclasses import FrozenInstanceError, replace
from functools import reduce
from operator import getitem

import pytest
import yaml

from docs.scripts import hooks
from pipeline.command_line.config import compose_experiment
from pipeline.settings.controllers import PLANNED
from pipeline.settings.experiment import Safety, SettingError, Sun
from pipeline.settings.keys import value_at
from pipeline.settings.schema import commented, completed, descriptions, experiment_from, schema, tables
from pipeline.settings.stages import STAGES
from tests.pipeline.command_line.cases import EVALUATE, FLY, leaves, plain_config
from tests.pipeline.flight.cases import mission
from tests.pipeline.flight.guarded import EARLY, guarded

CASES = [
    ("deputy.mass_kg", -12.0, "deputy.mass_kg is -12.0; it must be greater than 0 (kg)"),
    ("deputy.mass_kg", 9e-4, "deputy.mass_kg is 0.0009; it must be from 0.001 to 1e+06 (kg)"),
    ("deputy.mass_kg", math.nan, "deputy.mass_kg is nan; it must be a finite number"),
    ("deputy.mass_kg", "heavy", "deputy.mass_kg is 'heavy'; it must be a number"),
    ("deputy.mass_kg", True, "deputy.mass_kg is True; it must be a number"),
    ("deputy.min_distance_m", 250.0, "is 250.0 and deputy.max_distance_m is 200.0; the first must be less"),
    ("deputy.min_distance_m", -1.0, "deputy.min_distance_m is -1.0; it must be at least 0 (m)"),
    ("deputy.initial_position_m", [75.0, 0.0], "has 2 numbers; it must have three, [x, y, z] (m)"),
    ("deputy.initial_position_m", [0.0, 0.0, 0.0], "the chief's own place"),
    ("deputy.initial_position_m", 75.0, "deputy.initial_position_m is 75.0; it must be a list"),
    ("deputy.initial_velocity_m_s", [0.0, math.nan, 0.0], "initial_velocity_m_s[1] is nan; it must be a"),
    ("deputy.initial_velocity_m_s", [0.0, 800.0, 800.0], "its length must be at most 1000 (m/s)"),
    ("deputy.inertia_kg_m2", [[1, 0, 0], [0, 1, 0]], "it must be three rows of three numbers in kg m^2"),
    ("deputy.inertia_kg_m2", [[1, 0.2, 0], [0, 1, 0], [0, 0, 1]], "not symmetric; set [i][j] equal to"),
    ("deputy.inertia_kg_m2", [[1, 0, 0], [0, 1, 0], [0, 0, 0]], "moments 0, 1, 1 kg m^2; all must be"),
    ("deputy.inertia_kg_m2", [[1, 0, 0], [0, 1, 0], [0, 0, 3]], "no rigid body has one greater than the sum"),
    ("chief.num_points", 0, "chief.num_points is 0; it must be at least 1"),
    ("chief.num_points", 99.5, "chief.num_points is 99.5; it must be a whole number"),
    ("sensor.half_angle_deg", 181.0, "sensor.half_angle_deg is 181.0; it must be at most 180 (deg)"),
    ("sensor.boresight", [-1.0, 1.0, 0.0], "has length 1.41421; it must be a unit vector: divide it by its"),
    ("sun.mode", "randm", "sun.mode is 'randm'; it must be one of fixed, random, mixed; did you mean"),
    (
        "attitude.derivative_gain",
        2.0,
        "attitude.derivative_gain is 2, attitude_period_s is 1; the product of the last two is 2; it must",
    ),
    ("attitude.proportional_gain", 5.0, "attitude_period_s is 1; with these the deputy turns by 15.6 rad"),
    ("attitude_period_s", 10.0, "an error in rate into one 2.2 times as great: lower one of them"),
    ("attitude.pole_blending", "maybe", "attitude.pole_blending is 'maybe'; it must be true or false"),
    ("attitude_period_s", 3.0, "a whole number of times, as 3.33333 s does"),
    ("duration_s", 3605.0, "control_period_s is 10.0 s and duration_s is 3605.0 s"),
    ("duration_s", 1_000_010.0, "makes 100001 control periods; there must be at most 100000: shorten the"),
    ("starts.num_cases", 9, "octants are eight starts at one distance: set starts.num_cases=8"),
    ("starts.min_distance_m", 80.0, "is 80.0 and starts.max_distance_m is 75.0; the first must not be"),
    ("monte_carlo.min_distance_m", 5.0, "monte_carlo.min_distance_m is 5.0, outside the limits of the"),
    ("monte_carlo.max_distance_m", 300, "from deputy.min_distance_m=15 to deputy.max_distance_m=200 (m)"),
    ("optimizer.crossover_rate", 0.95, "together more than the whole population; lower one of them"),
    ("optimizer.stall_generations", 0, "optimizer.stall_generations is 0; it must be at least 1"),
    ("optimizer.encoding.output_range_n", [0.3, 0.01], "output_range_n[0] is 0.3 and"),
    ("optimizer.encoding.output_range_n", [0.3], "it must be a lower and an upper bound, [low, high]"),
    ("optimizer.encoding.standard_deviation_fraction", [0.0, 0.3], "fraction[0] is 0.0; it must be greater"),
    ("report.training_case", 8, "but there are 8 training scenarios; choose one from 0 to 7"),
    ("orbit.mean_motion_rad_s", 1e100, "mean_motion_rad_s is 1e+100; it must be at most 10 (rad/s)"),
    (
        "chief.inspection_radius_m",
        300.0,
        "deputy.max_distance_m is 200; the first must be less than the last, or all points lie beyond",
    ),
    ("chief.inspection_radius_m", 50.0, "a flight through the chief keeps its limits"),
    ("chief.initial_angular_velocity_rad_s", [0.0, 0.0, 11.0], "rad_s[2] is 11.0; it must be at most 10"),
    ("seed", 10**400, "seed is 1000000"),
    ("seed", 2**63, "seed is 9223372036854775808; it must be at most 9223372036854775807"),
    ("seed", -1, "seed is -1; it must be at least 0"),
    ("seed", "one", "seed is 'one'; it must be a whole number"),
    ("name", "a=b", "name is 'a=b'; it must be of letters, digits"),
    ("stages", [], f"stages is empty; name at least one of {', '.join(STAGES)}"),
    ("stages", ["reprt"], "stages has 'reprt'; did you mean report?"),
    ("stages", ["report", "evaluate"], f"name each once in the order {', '.join(STAGES)}"),
    ("stages", ["train"], "a controller of kind coast has nothing to train"),
    ("controller", {}, "controller is neither written out (systems) nor a file (path) nor of a kind"),
    ("controller", {"kind": "cost"}, f"{', '.join(PLANNED)}; did you mean coast?"),
    ("controller", {"kind": "coast", "path": "x"}, "controller.kind=coast; the keys are kind"),
    ("controller", {"path": "x", "name": "y"}, "the keys are kind, path"),
    ("safety.keep_out_margin_m", 0.0, "safety.keep_out_margin_m is 0.0; it must be at least 0.001 (m)"),
    ("safety.probability", 1.0, "safety.probability is 1.0; it must be at most 0.9999"),
    (
        "safety.keep_out_margin_m",
        190.0,
        "a radius of 205 m and the keep-in sphere 198; the first must be less",
    ),
    ("safety.braking_force_n", 1.1, "safety.braking_force_n is 1.1; it must be from 0 to 1 (N)"),
    ("safety.braking_force_n", 0.008, "to stand still 198 m above the chief takes 0.00873 N; raise it"),
    ("safety.speed_distance_m", 100.0, "m/s at the keep-out sphere (16 m); it must be at least"),
    ("deputy.min_distance_m", 197.5, "the first must be less than the second (m)"),
    ("hparams_search.space", {"seed": {"low": 2, "high": 1}}, "hparams_search.space.seed is"),
    ("hparams_search.space", {"seed": {"low": 0.0, "high": 1, "log": True}}, "with log positive"),
    ("hparams_search.space", {"seed": {"choices": [1]}}, "two or more"),
    ("hparams_search.space", {"seed": 3}, "give a range"),
    ("hparams_search.space", {"sede": {"choices": [1, 2]}}, "did you mean seed"),
    ("deputy", 3, "deputy is 3; it must be a group of keys: mass_kg"),
    ("engine", "dask", "kind, part_cases; did you mean engine.kind=dask?"),
]


def config_with(values, *words):
    """A configuration with some values, by the names of their keys."""
    config = plain_config(*words)
    for key, value in values.items():
        *groups, last = key.split(".")
        reduce(getitem, groups, config)[last] = value
    return config


@pytest.mark.parametrize(("key", "value", "message"), CASES, ids=[f"{k}={v}" for k, v, _ in CASES])
def test_impossible_values(key, value, message):
    words = refusal_of(config_with({key: value}, "light=shadow", "chief=tumbling", "safety=filter"))
    assert message in words
    assert "\n" not in words


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("controller.ring_sise_m", "did you mean controller.ring_size_m?"),
        ("controller.ring_size_m.inner", "did you mean controller.ring_size_m?"),
        ("controller.zzz", f"the keys there are {', '.join(plain_config('controller=lqr')['controller'])}"),
        ("navigation.fix_period_s", "navigation.mode=fixes, and navigation.mode is perfect"),
        ("dispersions.deputy.mass_kg", "is no key of this experiment"),
    ],
)
def test_a_search_over_a_key_that_is_not_there_is_refused_before_its_first_trial(key, message):
    tried = {"hparams_search.space": {key: {"low": 0.1, "high": 1.0}}, "stages": ["search"]}
    assert message in refusal_of(config_with(tried, "controller=lqr"))
    assert refusal_of(config_with({**tried, "stages": ["evaluate"]}, "controller=lqr")) is None
    fits = {"controller.ring_size_m": {"low": 40.0, "high": 90.0}}
    assert refusal_of(config_with({**tried, "hparams_search.space": fits}, "controller=lqr")) is None


def test_a_step_too_small_to_divide_by_is_refused():
    """Rounding to it would make full thrust of any command."""
    words = refusal_of(config_with({"actuators.impulse_step_n_s": 1e-311}, "actuators=real"))
    assert "is 1e-311; it must be from 1e-09 to 1e+06 (N s)" in words


def test_a_layer_that_keeps_the_deputy_off_its_goal_is_refused():
    with pytest.raises(SettingError, match="choose safety=none"):
        config_with({}, "problem=docking", "safety=filter")
    assert refusal_of(config_with({}, "problem=docking")) is None


def refusal_of(config):
    """Return in what words settings are refused; None where they are taken."""
    try:
        experiment_from(config)
    except SettingError as refusal:
        return str(refusal)


@pytest.mark.parametrize("value", ["text", "", ["x"], {"a": 1}, math.nan, math.inf, True, -5, None], ids=repr)
def test_a_key_takes_a_value_or_refuses_it_in_words(value):
    for key, _ in leaves(plain_config()):
        words = refusal_of(config_with({key: value}))
        assert words is None or (key.rpartition(".")[2] in words and "\n" not in words)


def test_unusual_values_that_can_be():
    values = {
        "attitude_period_s": (0.1, 5.0, 10.0 / 3.0),
        "sensor.half_angle_deg": (180.0,),
        "attitude.derivative_gain": (1.99,),
        "deputy.inertia_kg_m2": ([[2.0, 0.1, 0.0], [0.1, 3.0, -0.2], [0.0, -0.2, 4.0]],),
        "deputy.min_distance_m": (10.0,),
        "chief.initial_angular_velocity_rad_s": (None,),
        "optimizer.population_size": (1e3,),
        "optimizer.elitism_rate": (0.0,),
        "duration_s": (10, 1_000_000),
        "chief.num_points": (10_000,),
        "deputy.mass_kg": (1e-3,),
    }
    for key, each in values.items():
        assert [refusal_of(config_with({key: value})) for value in each] == [None] * len(each), key
    # gains do not matter to an attitude that is ideal
    config = plain_config("attitude=ideal", "attitude_period_s=10.0")
    assert experiment_from(config).mission.num_attitude_steps == 1


@pytest.mark.parametrize("position", [[10.0, 0.0, 0.0], [0.0, -200.1, 0.0]])
def test_a_recorded_start_lies_within_the_limits_of_the_flight(position):
    key, recorded = "deputy.initial_position_m", {"telemetry.record_start": True}
    distance = f"{math.dist(position, [0.0, 0.0, 0.0]):g}"
    words = refusal_of(config_with({key: position} | recorded))
    assert f"deputy.initial_position_m is {distance} m from the chief, outside" in words
    assert "from deputy.min_distance_m=15 to deputy.max_distance_m=200 (m): move" in words
    assert refusal_of(config_with({key: position})) is None
    assert refusal_of(config_with({key: [0.0, 15.0, 0.0]} | recorded)) is None


def test_missing_and_unknown_keys_of_a_composed_configuration():
    config = plain_config()
    del config["stages"]
    assert "the key stages is missing; give it a value, stages=" in refusal_of(config)
    unknown = refusal_of(config_with({"deputy.mass": 3.0}))
    assert "there is no key deputy.mass; did you mean deputy.mass_kg?" in unknown


def test_keys_of_earlier_versions_are_read_but_not_beside_todays():
    config = plain_config()
    expected = experiment_from(config)
    prices = config["optimizer"]["penalty"]
    for old, new in (("c_d", "outside_m_s"), ("c_95", "short_point_m_s"), ("c_99", "missed_point_m_s")):
        prices[old] = prices.pop(new)
    assert experiment_from(config) == expected
    assert "c_d" in prices
    prices["outside_m_s"] = 1.0
    with pytest.raises(SettingError, match=r"no key optimizer.penalty.c_d; did you mean .*outside_m_s"):
        experiment_from(config)


def test_every_value_is_checked_in_python_too():
    mission = experiment_from(plain_config()).mission
    with pytest.raises(SettingError, match=r"sun.angle_deg is nan; it must be a finite number"):
        Sun(mode="fixed", angle_deg=math.nan)
    with pytest.raises(SettingError, match=r"deputy.mass_kg is 0; it must be greater than 0 \(kg\)"):
        replace(mission.deputy, mass_kg=0)
    with pytest.raises(FrozenInstanceError):
        mission.duration_s = 1.0
    assert hash(mission) == hash(replace(mission, duration_s=3600))


def test_a_flight_is_no_larger_than_memory_and_prices_no_greater_than_all_numbers():
    points = config_with({"chief.num_points": 10_000, "duration_s": 100_000.0})
    assert "chief.num_points is 10000; that makes 1e+08 points of a flight; there may" in refusal_of(points)
    steps = config_with({"attitude_period_s": 0.001, "duration_s": 10_000.0})
    assert "that makes 1e+07 attitudes of a flight" in refusal_of(steps)
    prices = config_with({"optimizer.rounds": 1000, "optimizer.penalty.growth": 10.0})
    assert "by which prices grow to 1e1003 m/s" in refusal_of(prices)


IDLE = [
    ("sun.angle_deg=60 world=leo", "sun.angle_deg counts only with sun.mode=fixed or sun.mode=mixed, and"),
    ("sun.elevation_deg=20 world=leo", "counts only with sun.mode=fixed or sun.mode=mixed or"),
    ("orbit.eccentricity=0.3", "orbit.eccentricity counts only with dynamics.model=two_body, and"),
    ("dynamics.j2=0.001", "dynamics.j2 counts only with dynamics.model=two_body"),
    ("navigation.noise_m=50", "navigation.noise_m counts only with navigation.mode=fixes, and"),
    ("navigation.noise_m=50 navigation=range_bearing", "noise_m counts only with navigation.measures=pos"),
    ("actuators.delay_s=100", "actuators.delay_s counts only with actuators.kind=real, and actuators.kind"),
    ("actuators=real actuators.propellant_kg=2", "counts only with actuators.specific_impulse_s given"),
    ("safety.braking_force_n=0.5", "set that, or leave safety.braking_force_n out"),
    ("attitude=ideal attitude.derivative_gain=0.3", "derivative_gain counts only with attitude.mode=flown"),
    ("light.min_fraction=0.9", "light.min_fraction counts only with light.shadow=conical, and"),
    ("light=shadow light.ambient=[0,0,0]", "light.ambient counts only with light.reflection=blinn_phong"),
    ("chief.path=x.stl", "chief.path counts only with chief.shape=mesh, and chief.shape is sphere"),
    ("guidance.engine=sklearn", "guidance.engine counts only with guidance.kind=clusters"),
    ("optimizer=planes optimizer.split=rest", "optimizer.split counts only with optimizer.algorithm=genetic"),
    ("++dynamics={j2: 0.001}", "dynamics.j2 counts only with dynamics.model=two_body"),
    ("+dispersions.dynamics.j2={kind:uniform,low:0,high:0.01}", "counts only with dynamics.model=two_body"),
    (
        "+dispersions.navigation.noise_m={kind:uniform,low:1,high:2,correlation_s:60}",
        "dispersions.navigation.noise_m counts only with navigation.mode=fixes",
    ),
]


@pytest.mark.parametrize(("words", "message"), IDLE, ids=[words for words, _ in IDLE])
def test_a_key_that_counts_for_nothing_is_refused(words, message):
    overrides = [words] if words.startswith("++") else words.split(" ")
    with pytest.raises(SettingError) as refusal:
        compose_experiment([*FLY, *overrides])
    assert message in str(refusal.value)


COUNTING = [
    ("navigation.mode=fixes", "navigation.noise_m=5"),
    ("sun=random", "sun.elevation_range_deg=[-10,10]"),
    ("light=shadow", "orbit.radius_m=6878000"),
    ("safety.kind=filter", "safety.braking_force_n=0.5"),
    ("optimizer.rounds=2", "optimizer.next_round=carried"),
]


@pytest.mark.parametrize("words", COUNTING, ids=" ".join)
def test_a_key_that_counts_is_taken(words):
    key, _, value = words[-1].partition("=")
    assert value_at(compose_experiment([*FLY, *words]).config, key) == yaml.safe_load(value)


def test_what_counts_for_nothing_is_left_out_and_told_if_a_file_says_it(tmp_path, capsys):
    config = compose_experiment([*FLY, "world=leo", "sun=fixed", "sun.angle_deg=60"]).config
    assert config["sun"] == {"mode": "fixed", "angle_deg": 60, "elevation_deg": 0.0}
    assert capsys.readouterr().err == ""
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "own.yaml").write_text("# @package _global_\ndynamics: {j2: 0.001}\n")
    config = compose_experiment([*FLY, "world=own"], tmp_path).config
    assert config["dynamics"] == {"model": "cw"}
    assert "note: a file sets dynamics.j2, but dynamics.j2 counts only with" in capsys.readouterr().err


def test_keys_of_other_stages_are_told_or_refused_where_they_mislead(tmp_path, monkeypatch, ran):
    monkeypatch.chdir(tmp_path)
    output = ran("+experiment=assure", "controller=coast", "monte_carlo.num_cases=500", code=2)
    assert "monte_carlo.num_cases counts in the stages scenario, search, fit, train," in output.err
    words = ["optimizer.generations=5", "assurance.num_cases=5", "seed=3"]
    output = ran(*FLY, *words, "--cfg", "job")
    assert output.err == "note: no stage of this run reads optimizer.generations, assurance.num_cases\n"
    assert "mass_kg: 12.0" in output.out
    assert list(tmp_path.iterdir()) == []


START = "deputy.initial_position_m=[60,0,0]"


@pytest.mark.parametrize(
    ("words", "is_told"),
    [
        ([*FLY, START], False),
        ([*FLY, START, "case=5"], True),
        ([*EVALUATE, START], True),
        ([*EVALUATE, "world=rso"], False),
        (["+experiment=optimum", "optimum.cases=start", START], False),
    ],
)
def test_a_given_start_that_is_not_flown_is_told(words, is_told, ran):
    output = ran(*words, "--cfg", "job")
    assert output.err == is_told * "note: no stage of this run reads deputy.initial_position_m\n"
    assert "initial_position_m: [" in output.out


def test_a_configuration_of_the_first_version_is_read_with_its_idle_numbers():
    config = plain_config()
    expected = experiment_from(config)
    config["dynamics"] |= {"eccentricity": 0.3, "j2": 0.001}
    config["safety"]["braking_force_n"] = 99.0
    config["tracking"] = {"kind": "mlflow", "place": "sqlite:///x.db"}
    config["search"] = config.pop("hparams_search")
    del config["logger"]
    assert experiment_from(config) == expected


def test_a_configuration_holds_each_key_that_counts_and_no_other():
    config = plain_config("navigation=fixes")
    assert completed(config) == config
    for key in schema().values():
        node = config
        for name in key.name.split("."):
            node = node.get(name, key) if isinstance(node, dict) else key
        assert (node is not key) == key.exists(config), key.name


def test_every_key_and_group_has_a_meaning_and_a_row():
    names = {*schema(), *tables()} - {""}
    assert [name for name in names if not descriptions().get(name, "").endswith(".")] == []
    rows = hooks.tables_of_keys().splitlines()
    assert "`mass_kg` **d**|`12.0` kg|greater than 0|Mass." in rows
    (row,) = (row for row in rows if row.startswith("`range_noise_m`"))
    assert row.startswith("`range_noise_m` **t**|`0.1` m|greater than 0|Standard deviation of a range.")
    assert row.endswith("Only with `navigation.measures=range_bearing`.")


def test_a_commented_configuration_reads_back_to_the_same_data():
    config = plain_config("navigation=fixes", "+dispersions.deputy.mass_kg={kind:uniform,low:10,high:14}")
    text = commented(config)
    assert yaml.safe_load(text) == config
    assert "  # Mass. (kg)\n  mass_kg: 12.0\n" in text


def test_the_options() -> None:
    assert mission().safety == Safety()
    words = ((), ("safety=filter",), ("safety=passive",), ("safety=none",))
    left_out, on, passive, off = (experiment_from(plain_config(*each)).mission for each in words)
    assert (on.keep_out_m, on.keep_in_m) == (16.0, 198.0)
    # one orbit is 2 pi / n = 5,677 s; otherwise the two are the same
    assert passive.safety == replace(on.safety, passive_horizon_s=5677.0)
    assert left_out == off == replace(on, safety=replace(on.safety, kind="none"))


def test_a_layer_that_is_off_refuses_no_limits() -> None:
    """Its numbers count only where it is on: other missions need not fit them."""
    off = replace(EARLY, kind="none")
    assert guarded(off, deputy={"min_distance_m": 197.5}).safety == off
