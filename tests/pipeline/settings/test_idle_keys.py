"""A key that another setting makes idle does not exist: it is refused, told or passed over, never obeyed."""

import re
from dataclasses import replace

import pytest
import yaml

from docs import hooks
from pipeline.command_line.config import compose_experiment
from pipeline.settings.experiment import Safety, SettingError
from pipeline.settings.keys import value_at
from pipeline.settings.schema import commented, completed, descriptions, experiment_from, schema, tables
from tests.pipeline.command_line.cases import FLY, plain_config
from tests.pipeline.flight.cases import mission
from tests.pipeline.flight.guarded import EARLY, guarded

IDLE = [
    ("sun.angle_deg=60 world=leo", "sun.angle_deg counts only with sun.mode=fixed or sun.mode=mixed, and"),
    ("sun.elevation_deg=20 world=leo", "counts only with sun.mode=fixed or sun.mode=mixed or"),
    ("dynamics.eccentricity=0.3", "dynamics.eccentricity counts only with dynamics.model=two_body, and"),
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
    ("light=shadow", "orbit.radius_m=7000000"),
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
    told = ran("+experiment=assure", "controller=coast", "monte_carlo.num_cases=500", code=2)
    assert "monte_carlo.num_cases counts in the stages scenario, search, train," in told.err
    words = ["optimizer.generations=5", "assurance.num_cases=5", "seed=3"]
    told = ran(*FLY, *words, "--cfg", "job")
    assert told.err == "note: no stage of this run reads optimizer.generations, assurance.num_cases\n"
    assert "mass_kg: 12.0" in told.out
    assert list(tmp_path.iterdir()) == []


def test_a_configuration_of_the_first_version_is_read_with_its_idle_numbers():
    config = plain_config()
    told = experiment_from(config)
    config["dynamics"] |= {"eccentricity": 0.3, "j2": 0.001}
    config["safety"]["braking_force_n"] = 99.0
    config["tracking"] = {"kind": "mlflow", "place": "sqlite:///x.db"}
    config["search"] = config.pop("hparams_search")
    del config["logger"]
    assert experiment_from(config) == told


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


def test_help_on_a_group_a_key_and_what_is_no_key(ran):
    assert "  safety.braking_force_n=0.8 N\n      Greatest force along each" in ran("--help", "safety").out
    told = ran("--help", "sun.mode", "seed").out
    assert "(fixed, random, mixed)" in told
    assert "  seed=1\n" in told
    assert "did you mean deputy.mass_kg?" in ran("--help", "deputy.mass", code=2).err


@pytest.mark.parametrize("words", [["--help", "train_polish"], ["+experiment=train_polish", "--help"]])
def test_help_on_an_experiment_shows_what_people_change_with_its_values(words, ran):
    told = ran(*words).out
    assert told.startswith("+experiment=train_polish: Polish all but the rules")
    shown = re.findall(r"^  ([\w.]+)=(.*)$", told, re.MULTILINE)
    assert len(shown) == 11  # the stages, and ten keys or groups
    composed = compose_experiment(["+experiment=train_polish", "controller=champion_27"]).config
    values = {key: yaml.safe_load(value) for key, value in shown if value != "NAME"}
    assert values == {key: value_at(composed, key) for key in values}
    assert "optimizer.population_size" in values
    assert "assurance.num_cases" not in values


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
