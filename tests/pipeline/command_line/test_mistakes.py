"""A mistake is told in a sentence that names the right word, and leaves no folder behind."""

from pathlib import Path

import pytest

from pipeline.command_line.cli import COMMANDS
from pipeline.command_line.config import AT_THE_TOP
from pipeline.settings.places import conf_folder
from pipeline.settings.stages import STAGES
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages

LQR = ["+experiment=fly", "controller=lqr"]
OPTIMUM, BASELINES = ["+experiment=optimum"], ["+experiment=baselines"]

MISTAKES = [
    # keys
    (["+experimnt=train"], "there is no key experimnt; did you mean +experiment?"),
    (["experiment=train"], "write +experiment=train"),
    ([*FLY, "sede=3"], "there is no key sede; did you mean seed?"),
    ([*FLY, "+sede=3"], "there is no key sede; did you mean seed?"),
    ([*FLY, "~sede"], "there is no key sede; did you mean seed?"),
    ([*FLY, "+seed=3"], "the key seed exists already; write seed=3 without the +"),
    ([*FLY, "+optimizer.popp=3"], "did you mean optimizer.population_size?"),
    ([*FLY, "++optimiser.population_size=3"], "did you mean optimizer.population_size?"),
    ([*FLY, "population_size=3"], "did you mean optimizer.population_size?"),
    (
        [*FLY, "optimizer.penalty.c_d=3"],
        "no key optimizer.penalty.c_d; did you mean optimizer.penalty.outside_m_s?",
    ),
    ([*FLY, "deputy.mass=3"], "did you mean deputy.mass_kg?"),
    ([*FLY, "monte_carlo.cases=3"], "did you mean monte_carlo.num_cases?"),
    ([*FLY, "xyzzy=3"], "there is no key xyzzy\n"),
    ([*FLY, "+deputy={mas_kg:3}"], "the key deputy exists already"),
    ([*FLY, "++deputy={mas_kg:3}"], "there is no key deputy.mas_kg; did you mean deputy.mass_kg?"),
    ([*FLY, "hydra.runn.dir=x"], "there is no key hydra.runn; did you mean hydra.run?"),
    ([*FLY, "+controller.knd=x"], "no key controller.knd with controller.kind=coast; did you mean kind?"),
    ([*FLY[:1], "controller=aim", "controller.attributes.skirt_distance=9"], "mean skirt_distance_m?"),
    # options
    (["+experiment=trian"], "there is no experiment=trian; did you mean train?"),
    (["+experiment=train,trian", "-m"], "there is no experiment=trian; did you mean train?"),
    ([*FLY, "sun=randm"], "there is no sun=randm; did you mean random? The choices are fixed, mixed, random"),
    ([*FLY, "sun=qqqqqq"], "there is no sun=qqqqqq; the choices are fixed, mixed, random\n"),
    ([*FLY, "stages=[qqqqqq]"], f"stages has 'qqqqqq'; the stages are {', '.join(STAGES)}"),
    ([*FLY, "+sun=random"], "sun is chosen already; write sun=random without the +"),
    ([*FLY, "++sun=randm"], "did you mean random?"),
    (["+experiment=fly", "controller=cost"], "there is no controller=cost; did you mean coast?"),
    (["+experiment=fly", "controller=file"], "the key controller.path has no value yet; add"),
    (["+experiment=fly", "controller=a/F.CSV"], "a/F.CSV cannot be read (["),
    (["+experiment=fly", "controller.path=own.json"], "the controller that is chosen has no path; write"),
    # choices not made
    (["seed=3", "controller=coast"], "no experiment is chosen; add +experiment=NAME, where NAME is one of"),
    ([*FLY, "seed=1,2"], "seed=1,2 gives several values; add -m"),
    # grammar
    ([*FLY, "name=[a"], "'name=[a' cannot be read as key=value"),
    ([*FLY, "name=${nme}"], "nme"),
    ([*FLY, "--config-name=other"], "--config-name would replace our configuration"),
    ([*FLY, "--multrun"], "there is no option --multrun; did you mean --multirun?"),
    ([*FLY, "--multi"], "there is no option --multi; did you mean --multirun?"),
    ([*FLY, "-x"], "there is no option -x"),
    ([*FLY, "--seed=3"], "there is no option --seed=3; did you mean seed?"),
    ([*FLY, "-m", "sun=interval(1,2)"], "sun=interval(1,2) is an interval, or empty"),
    (
        [*FLY, "-m", "seed=range(0,1000000000)"],
        "with seed=range(0,1000000000) these are 1,000,000,000 runs; give at most",
    ),
    ([*FLY, "-m", "seed=shuffle(range(0,1000000000))"], "these are 1,000,000,000 runs; give at most"),
    ([*FLY[:1], "-m", "controller=range(0,1000000000)"], "these are 1,000,000,000 runs; give at most"),
    ([*FLY, "-m", "seed=range(0,5000)", "sun=fixed,random,mixed"], "these are 15,000 runs; give at most"),
    ([*FLY, "-m", "seed=range(nan,5)"], "seed=range(nan,5) is an interval, or empty"),
    ([*FLY, "-m", "seed=range(1,3,0)"], "seed=range(1,3,0) is an interval, or empty"),
    ([*FLY[:1], "controller=[coast,lqr]"], "controller=[coast,lqr] gives a list; give one of controller"),
    ([*FLY, "-m", "seed=range(3,1)"], "seed=range(3,1) is an interval, or empty; give values, as key=1,2"),
    ([*FLY, "hydra.job.chdir=maybe"], "hydra.job.chdir=maybe: Value 'maybe'"),
    ([*FLY, "hydra.run.dir="], "hydra.run.dir= names no folder; write one behind it, or leave it out"),
    ([*FLY, "-m", "seed=1,2", "hydra.sweep.dir=''"], "hydra.sweep.dir='' names no folder"),
    ([*FLY, "++hydra.run.dir="], "hydra.run.dir= names no folder"),
    ([*FLY, 'hydra.run.dir=" "'], "names no folder"),
    (["resume="], "resume= names no folder"),
    ([*FLY, "--cfg", "jo"], "invalid choice: 'jo'"),
    ([*FLY, "--config-dir"], "expected one argument"),
    ([*FLY, "--config-dir=nowhere"], "--config-dir nowhere is no folder"),
    ([*FLY, "--experimental-rerun=x.pickle"], "would load a pickle"),
    (
        ["check", "x"],
        "the commands are again, compare, edit, export_c, fly, merge, repeat, summary, verify, warm.",
    ),
    # values
    ([*FLY, "deputy.mass_kg=-1"], "deputy.mass_kg is -1; it must be greater than 0 (kg)"),
    (
        [*FLY, "+dispersions.deputy.mass_kg={kind:uniform,low:-1,high:11}"],
        "draws an impossible value: deputy.",
    ),
    ([*FLY, "+dispersions.sensor.half_angle_deg={kind:normal,mean:9,std:99,high:181}"], "is 181.0; it must"),
    ([*FLY, "seed=1,-2", "-m"], "seed is -2; it must be at least 0"),
    (["+experiment=train", "controller=champion_27"], "use Gaussian, or +experiment=train_readable_late"),
    (["+experiment=train", "guidance=clusters", "guidance.engine=sklearn"], "guidance.engine is sklearn"),
    ([*OPTIMUM, "optimum.points=100"], "optimum.points is 100, but the chief has 99 points"),
    ([*OPTIMUM, "optimum.burns=6"], "optimum.burns is 6; it must be at most 5"),
    ([*OPTIMUM, "optimum.cases=all"], "optimum.cases is 'all'; it must be one of evaluation, start"),
    ([*BASELINES, "compare.controllers=[]"], "compare.controllers is []; name at least one, and each once"),
    ([*BASELINES, "compare.controllers=[lqr,coast,lqr]"], "compare.controllers is [lqr, coast, lqr]"),
    (
        [*BASELINES, "compare.suns=[fixd]"],
        "compare.suns[0] is 'fixd'; it must be one of fixed, random, mixed",
    ),
    ([*BASELINES, "compare.safety=[on]"], "compare.safety"),
    ([*BASELINES, "compare.controllers=[lqrr]"], "no controller lqrr; did you mean lqr? The controllers"),
    ([*BASELINES, "compare.controllers=[qqqq]"], "there is no controller qqqq; the controllers are aim"),
    ([*BASELINES, "compare.controllers=[coast,open_loop]"], "there is no controller open_loop"),
    ([*OPTIMUM, "light=blinn_phong"], "light.reflection is blinn_phong, which plans of least"),
    ([*LQR, "controller.follows=route", "light=blinn_phong"], "is blinn_phong, which plans of least fuel"),
    # files
    (["+experiment=fly", "controller=nowhere.json"], "nowhere.json: cannot be read (no such file or"),
    (["+experiment=fly", "controller=nowhere.yaml,other.json", "-m"], "nowhere.yaml: cannot be read"),
    (["+experiment=fly", "controller=coast,other.json", "-m"], "mixes names and paths"),
    ([*BASELINES, "compare.controllers=[coast,missing.csv]"], "missing.csv cannot be read"),
    ([*EVALUATE, "optimum.reference=none"], "none has no optimum/cases.parquet; the stage optimum writes it"),
    (["+experiment=fit_mission", "fit.bases=[lqr]"], "fit.bases has lqr, which has no rules to scale"),
    (
        ["+experiment=fit_mission", "fit.planners=[coast]"],
        "fit.planners has coast, which has no rules to scale",
    ),
    # commands about one evaluation
    (["export_c", "controller=lqr", "-o", "c"], "'lqr' has no rules; choose a controller that has"),
    (
        ["export_c", "controller=coast", "-o", "c", "--flights=0"],
        "--flights is 0; it must be from 1 to 10000",
    ),
    (
        ["export_c", "controller=coast,lqr", "-m", "-o", "c"],
        "export_c takes no -m; it is about one evaluation",
    ),
    (["edit", "x"], "edit takes no x; it is about one evaluation, by key=value"),
    (["edit", "controller=coast", "x"], "edit takes no x; it is about one evaluation, by key=value"),
    (["export_c", "controller=coast", "-o", "c", "seed=1,2"], "seed=1,2 gives several values; give one, or"),
    (["edit", "controller=coast", "resume=x"], "edit takes no resume=x; it is about one evaluation"),
    (["edit", "controller=coast", "--port=65536"], "--port is 65536; it must be from 0 to 65535"),
    (["resume=nowhere"], "nowhere is no folder; give the folder of a run"),
]


@pytest.mark.parametrize(("arguments", "message"), MISTAKES, ids=[" ".join(words) for words, _ in MISTAKES])
def test_mistakes(arguments, message, tmp_path, monkeypatch, ran):
    monkeypatch.chdir(tmp_path)
    called = use_stages(monkeypatch)
    printed = ran(*arguments, code=2).err
    assert printed.startswith("error: ")
    assert message in printed
    assert printed.count("\n") == 1
    assert called == []
    assert list(tmp_path.iterdir()) == []


def test_a_file_with_the_name_of_one_that_ships_is_refused(tmp_path, ran):
    path = tmp_path / "world" / "leo.yaml"
    path.parent.mkdir()
    words = [*FLY, "--config-dir", str(tmp_path), "--cfg", "job"]
    path.write_bytes((conf_folder() / "world" / "leo.yaml").read_bytes())
    assert ran(*words).err == ""
    path.write_text("# @package _global_\nduration_s: 600.0\n")
    assert f"{path} has the name of one that ships" in ran(*words, code=2).err


def test_a_controller_that_looks_for_points_is_told_where_there_are_none(tmp_path, monkeypatch, ran):
    use_stages(monkeypatch)
    for name, is_told in (("champion_27", True), ("steady", False)):
        run_dir = f"hydra.run.dir={tmp_path / name}"
        printed = ran("+experiment=evaluate", "problem=docking", f"controller={name}", run_dir).err
        assert (f"note: {name} senses aim_radial, aim_along_track" in printed) == is_told


NO_CONTROLLER = '{"schema": "fuzzy-controller", "schema_version": 99, "name": "x", "systems": []}'


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("defaults:\n  - override /sun: randm\nname: own\nstages: [record]\n", "did you mean sun/random?"),
        ("name: own\nstages: [record]\ndeputy:\n  mas_kg: 3\n", "did you mean deputy.mass_kg?"),
        ("name: own\nstages: [record]\nsede: 3\n", "there is no key sede; did you mean seed?"),
        ("name: own\nstages: [record\n", "error: no YAML: while parsing a flow sequence"),
        (
            "- name: own\n- stages: [record]\n",
            "mine/experiment/own.yaml is no mapping; write settings into it",
        ),
        ("own\n", "mine/experiment/own.yaml is no mapping; write settings into it as key: value, or move it"),
        ("5\n", "mine/experiment/own.yaml is no mapping"),
        (NO_CONTROLLER[:40], "controller.json"),
        (NO_CONTROLLER, "99"),
        ("[1, 2]", "controller.json"),
    ],
)
def test_mistakes_in_files_of_the_users(content, message, tmp_path, monkeypatch, ran):
    monkeypatch.chdir(tmp_path)
    if content.startswith(("{", "[")):
        Path("controller.json").write_text(content)
        words = ["+experiment=fly", "controller=controller.json"]
    else:
        Path("mine/experiment").mkdir(parents=True)
        Path("mine/experiment/own.yaml").write_text("# @package _global_\n" + content)
        words = ["+experiment=own", "controller=coast", "--config-dir", "mine"]
    assert message in ran(*words, code=2).err
    assert not (tmp_path / "outputs").exists()


@pytest.mark.parametrize("defaults", ["", "defaults:\n  - override /controller: coast\n"])
@pytest.mark.parametrize("group", AT_THE_TOP)
def test_a_file_without_the_line_that_puts_its_keys_at_the_top_is_named(
    group, defaults, tmp_path, monkeypatch, ran
):
    monkeypatch.chdir(tmp_path)
    Path("mine", group).mkdir(parents=True)
    Path("mine", group, "own.yaml").write_text(f"{defaults}duration_s: 600\nstages: [record]\n")
    words = ["controller=coast", f"+{group}=own", "--config-dir", "mine"]
    if group != "experiment":
        words = [*FLY, f"{group}=own", "--config-dir", "mine"]
    said = ran(*words, code=2).err
    folder = "" if defaults else "mine/"  # Hydra fails before it tells the folder
    assert f"{folder}{group}/own.yaml lacks the line `# @package _global_`" in said
    assert "did you mean" not in said


def test_every_group_whose_files_need_that_line_is_known():
    need = {
        path.parent.name
        for path in conf_folder().rglob("*.yaml")
        if "# @package _global_" in path.read_text(encoding="utf-8")
    }
    # problem has keys of its own, too
    assert need - {"problem"} == set(AT_THE_TOP)


def test_what_is_no_file_among_configurations_is_passed_over(tmp_path, ran):
    """Editors leave links to nowhere beside a file that is not saved yet."""
    world = tmp_path / "world"
    (world / "folder.yaml").mkdir(parents=True)
    (world / ".#own.yaml").symlink_to("nobody@nowhere.1")
    (world / "own.yaml").write_text("# @package _global_\nduration_s: 600\n")
    assert "duration_s: 600" in ran(*FLY, f"--config-dir={tmp_path}", "world=own", "--cfg", "job").out


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_tells_what_it_does_and_does_nothing(command, ran):
    assert f"\nUsage: python -m pipeline {command}" in ran(command, "--help").out
