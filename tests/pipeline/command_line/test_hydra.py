"""What users of Hydra know works here: options, callbacks, sweeps, calls in Python; labels tell what flew."""

import logging
import os
import shutil
import sys
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from hydra._internal.utils import get_args_parser
from omegaconf import OmegaConf

from pipeline.command_line.arguments import REFUSED
from pipeline.command_line.cli import main
from pipeline.command_line.config import compose_experiment
from pipeline.report import sweep as report
from pipeline.run import artifacts, configuration, sweep, tables
from pipeline.run.lock import LOCK
from pipeline.settings.places import conf_folder
from pipeline.settings.schema import completed
from tests.pipeline.command_line.cases import EVALUATE, FLY, use_stages


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def configurations(folder: str) -> dict[str, dict]:
    """The configurations of a sweep's runs, by what its file says that they differ in."""
    return {
        str(run.differs): configuration.read(Path(folder, run.folder)) for run in sweep.read(Path(folder))
    }


def test_a_key_that_is_given_twice_labels_runs_by_what_they_fly(monkeypatch, ran):
    called = use_stages(monkeypatch)
    ran(
        "-m", *EVALUATE, "controller=champion_27,lqr", "seed=1,2", "controller=coast", "hydra.sweep.dir=twice"
    )
    configs = configurations("twice")
    assert list(configs) == ["{'seed': '1'}", "{'seed': '2'}"]
    assert [config["controller"] for config in configs.values()] == [{"kind": "coast"}] * 2
    assert {experiment.controller["kind"] for _, experiment, _ in called} == {"coast"}
    assert sorted(path.name for path in Path("twice").iterdir() if path.is_dir()) == ["seed=1", "seed=2"]


def test_labels_are_what_was_composed(monkeypatch, ran):
    use_stages(monkeypatch)
    words = ["controller=lqr,receding_horizon", "controller.ring_size_m=40", "deputy.mass_kg=11.5,12"]
    words += ["sun=fixed,random"]
    ran("-m", *FLY[:1], *words, "hydra.sweep.dir=s")
    for run in sweep.read(Path("s")):
        config = configuration.read(Path("s", run.folder))
        assert run.differs["controller"] == config["controller"]["kind"]
        assert float(run.differs["controller.ring_size_m"]) == config["controller"]["ring_size_m"] == 40
        assert float(run.differs["deputy.mass_kg"]) == config["deputy"]["mass_kg"]
        assert run.differs["sun"] == config["sun"]["mode"]
        assert run.folder == "+".join(f"{key}={value}" for key, value in run.differs.items())


SAME = [
    (["seed=2,2"], "two runs of the sweep would have seed=2"),
    (["duration_s=600,600.0"], "two runs of the sweep would have duration_s=600"),
    (
        ["deputy.mass_kg=10,12", "++deputy={mass_kg: 11}"],
        "two runs of the sweep would have deputy.mass_kg=11",
    ),
    (["controller=coast,coast"], "two runs of the sweep would have controller=coast"),
    (["seed=1,2", "hydra.sweep.subdir=one"], "two runs would have the folder one"),
    (["seed=1,2", "hydra.sweep.subdir=../x${seed}"], "seed=1: hydra.sweep.subdir is ../x1; name"),
    (["+experiment=evaluate"], "+experiment=fly and +experiment=evaluate are given; keep one"),
    (["hydra.searchpath=[nowhere]"], "hydra.searchpath nowhere is no folder"),
    (["hydra.sweep.dir=A,B"], "hydra.sweep.dir=A,B gives several values, and a sweep takes one"),
    (["hydra/launcher=basic,joblib"], "gives several values, and a sweep takes one"),
    (["controller=glob(x*)"], "controller=glob(x*) matches none; the choices are aim, "),
    (
        ["controller=glob([coast,f*])"],
        "in the run with controller=file: the key controller.path has no value yet",
    ),
    (
        ["controller=coast,lqr", "controller.ring_size_m=40,60"],
        "in the run with controller=coast, controller.ring_size_m=40: there is no key controller.ring_size_m",
    ),
    (
        ["controller=glob(ch*)", "controller.path=x"],
        "in the run with controller=champion_27, controller.path=x: there is no key controller.path: the",
    ),
    (["seed=1,2", "hydra/sweeper=other"], "Could not find 'hydra/sweeper/other'; did you mean"),
    (["seed=1,-2"], "in the run with seed=-2: seed is -2; it must be"),
    (["hydra.jobb.chdir=true"], "there is no key hydra.jobb; did you mean hydra.job?"),
    (["hydra.launcher.jobs=2"], "there is no key hydra.launcher.jobs: the launcher that is chosen"),
    (["hydra/launchers=joblib"], "there is no key hydra/launchers; did you mean hydra/launcher?"),
]


@pytest.mark.parametrize(("words", "message"), SAME, ids=[" ".join(words) for words, _ in SAME])
def test_a_sweep_that_cannot_be_is_refused_before_anything_is_made(
    words, message, tmp_path, monkeypatch, ran
):
    called = use_stages(monkeypatch)
    begin = FLY[:1] if words[0].startswith("controller") else FLY
    printed = ran("-m", *begin, *words, code=2).err
    assert printed.startswith("error: ")
    assert message in printed
    assert called == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("word", ["+experiment=fly,evaluate", "name=a,b", "+hydra.sweeper.params.name='a,b'"])
def test_experiments_and_names_may_vary_in_a_sweep(word, monkeypatch, ran):
    use_stages(monkeypatch)
    base = [] if word.startswith("+experiment") else FLY[:1]
    mode = "hydra.mode=MULTIRUN" if word == "name=a,b" else "-m"
    ran(mode, *base, "controller=coast", word, "stages=[scenario]", "hydra.sweep.dir=s")
    key, _, values = word.lstrip("+").removeprefix("hydra.sweeper.params.").partition("=")
    folders = [f"{key}={value}" for value in values.strip("'").split(",")]
    assert [run.folder for run in sweep.read(Path("s"))] == folders


def test_a_sweep_with_a_deleted_run_goes_on(monkeypatch, ran):
    use_stages(monkeypatch)
    words = ["-m", *FLY, "hydra.sweep.dir=s", "seed=1,2,3"]
    ran(*words)
    before = configuration.read(Path("s/seed=2"))
    shutil.rmtree("s/seed=2")
    assert "drop seed=5" in ran("resume=s", "seed=5", code=2).err
    assert "drop sun=random" in ran("resume=s", "sun=random", code=2).err
    called = use_stages(monkeypatch)
    (Path("s") / LOCK).write_text("")  # of a process that was killed
    ran("resume=s")
    assert [experiment.seed for _, experiment, _ in called] == [2]
    assert configuration.read(Path("s/seed=2")) == before
    (Path("s") / LOCK).write_text("")
    assert "nothing is left to do" in ran("resume=s").err
    assert not (Path("s") / LOCK).exists()


def test_a_sweep_is_extended_and_what_is_finished_stays(monkeypatch, ran):
    use_stages(monkeypatch)
    ran("-m", *FLY, "hydra.sweep.dir=s", "seed=1,2")
    called = use_stages(monkeypatch)
    ran("-m", *FLY, "hydra.sweep.dir=s", "seed=2,3")
    assert [experiment.seed for _, experiment, _ in called] == [3]
    assert [run.folder for run in sweep.read(Path("s"))] == ["seed=1", "seed=2", "seed=3"]


def test_folders_of_runs_that_are_no_sweep_are_summarised_by_what_differs(monkeypatch, ran):
    """Those of a job array, or of a sweep of an earlier version whose file is lost."""
    use_stages(monkeypatch)
    for number, (mass, controller) in enumerate([(10, "coast"), (12, "coast"), (12, "natural_motion")]):
        folder = f"hydra.run.dir=runs/{number}"
        ran(*EVALUATE[:1], f"controller={controller}", f"deputy.mass_kg={mass}", "seed=4", folder)
    runs = sweep.gather_runs(Path("runs"))
    assert [run.folder for run in runs] == ["0", "1", "2"]
    assert [run.differs["deputy.mass_kg"] for run in runs] == ["10.0", "12.0", "12.0"] or [
        run.differs["deputy.mass_kg"] for run in runs
    ] == ["10", "12", "12"]
    assert [run.differs["controller"] for run in runs] == ["coast", "coast", "natural_motion"]
    assert {key for run in runs for key in run.differs} == {"controller", "deputy.mass_kg"}
    ran("summary", "runs")
    assert tables.read_parquet(Path("runs"), "summary.parquet")["run"].tolist() == ["0", "1", "2"]
    os.symlink("runs/0", "runs/3")
    assert len(report.gather_results(Path("runs")).runs) == 3


def test_hydras_options_work(capfd):
    """Those that print; what they print is Hydra's."""
    options = {name for action in get_args_parser()._actions for name in action.option_strings}
    assert options > set(REFUSED)
    handlers = list(logging.getLogger().handlers)
    for words, message in (
        (["--info"], "Defaults List"),
        (["--info", "searchpath"], "Config search path"),
        (["--cfg", "hydra"], "sweep:"),
        (["--cfg", "all", "-p", "hydra.run"], "dir: outputs/${name}"),
        (["--cfg", "job", "--resolve", "-p", "deputy.mass_kg"], "12.0"),
    ):
        assert main([*words, *FLY]) == 0
        assert logging.getLogger().handlers == handlers
        printed = capfd.readouterr()
        assert message in printed.out + printed.err, words
    assert main([*FLY, "--cfg", "job", "-p", "nothing"]) == 2
    assert capfd.readouterr().err == "package 'nothing' not found in config\n"
    assert main(["--hydra-help"]) == 0
    assert "== Flags ==" in capfd.readouterr().out
    for option in REFUSED:
        assert main([*FLY, f"{option}=x"]) == 2


def test_a_shell_completes_keys_and_options(monkeypatch, capsys):
    monkeypatch.delenv("COMP_LINE", raising=False)
    assert main(["-sc", "query=bash"]) == 2
    assert "is asked by a shell, which sets COMP_LINE; to let it" in capsys.readouterr().err
    for line, expected in (("x deputy.mass", "deputy.mass_kg="), ("x sun=ran", "sun=random")):
        monkeypatch.setenv("COMP_LINE", line)
        monkeypatch.setenv("COMP_POINT", str(len(line)))
        assert main(["-sc", "query=bash"]) == 0
        assert capsys.readouterr().out.split() == [expected]
    assert main(["-sc", "install=bash"]) == 0
    assert "COMP_LINE" in capsys.readouterr().out


CALLBACK = """
from hydra.experimental.callback import Callback
class Telling(Callback):
    def on_job_end(self, config, job_return, **_):
        print("ended with", job_return.return_value)
"""


def test_callbacks_of_the_users_are_called(monkeypatch, ran, tmp_path):
    use_stages(monkeypatch)
    (tmp_path / "telling.py").write_text(CALLBACK)
    monkeypatch.syspath_prepend(tmp_path)
    printed = ran(*FLY, "+hydra.callbacks.mine._target_=telling.Telling", "hydra.run.dir=run").out
    assert printed.splitlines() == ["run", "ended with 0"]


def test_a_run_may_have_its_folder_as_the_working_directory(monkeypatch, ran, tmp_path):
    there = []
    use_stages(monkeypatch, record=lambda _experiment, _folder: there.append(Path.cwd()))
    before = Path.cwd()
    assert ran(*FLY, "hydra.job.chdir=true", "hydra.run.dir=run").out == f"{tmp_path / 'run'}\n"
    assert (there, Path.cwd()) == ([tmp_path / "run"], before)


def test_a_relative_path_is_refused_where_the_run_would_not_find_it(ran):
    shutil.copy(conf_folder() / "controller/champion_27.yaml", "mine.yaml")
    for more in ([], ["-m", "seed=1,2"]):
        words = [*FLY[:1], "controller=mine.yaml", "hydra.job.chdir=true", *more]
        assert "controller.path is mine.yaml, and with hydra.job.chdir=true" in ran(*words, code=2).err
    assert [path.name for path in Path().iterdir()] == ["mine.yaml"]


def test_the_search_path_is_searched(monkeypatch, ran, tmp_path):
    use_stages(monkeypatch)
    (tmp_path / "mine/experiment").mkdir(parents=True)
    (tmp_path / "mine/experiment/drift.yaml").write_text(
        "# @package _global_\ndefaults: [/experiment/fly]\nname: drift\n"
    )
    helped = ran("--config-dir", str(tmp_path / "mine"), "--help", "drift").out
    assert helped.startswith("+experiment=drift: \n  stages=[record]")
    path = f"hydra.searchpath=[file://{tmp_path / 'mine'}]"
    ran("+experiment=drift", "controller=coast", path, "hydra.run.dir=run")
    assert configuration.read(Path("run"))["name"] == "drift"
    assert "did you mean" in ran("+experiment=drfit", "controller=coast", path, code=2).err


def test_an_option_of_the_users_is_added_where_none_ships(ran, tmp_path):
    (tmp_path / "mine/report").mkdir(parents=True)
    (tmp_path / "mine/report/own.yaml").write_text("title: My flights\n")
    words = ["--config-dir", str(tmp_path / "mine"), *EVALUATE, "--cfg", "job"]
    assert "title: My flights" in ran(*words, "+report=own").out
    assert "write +report=own" in ran(*words, "report=own", code=2).err


def test_verbose_prints_what_libraries_say(monkeypatch, capfd):
    use_stages(monkeypatch)
    assert main([*FLY, "hydra.verbose=true", "hydra.run.dir=run"]) == 0
    assert "[pipeline] stage record took" in capfd.readouterr().err
    assert main([*FLY, "hydra.run.dir=other"]) == 0
    assert "stage record took" not in capfd.readouterr().err


def test_hydra_composes_the_whole_configuration_in_python():
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        config = compose("config", ["+experiment=evaluate", "controller=coast"])
    plain = OmegaConf.to_container(config)
    assert completed(plain) == compose_experiment(EVALUATE).config
    assert plain["deputy"]["mass_kg"] == 12.0


def test_a_command_returns_in_python_and_leaves_hydra_as_it_was(monkeypatch):
    use_stages(monkeypatch)
    arguments, environment = list(sys.argv), dict(os.environ)
    with initialize_config_dir(str(conf_folder()), version_base="1.3"):
        before = compose("config", ["+experiment=fly"])
        assert main(["-m", *FLY, "seed=1,2", "hydra.sweep.dir=s"]) == 0
        assert main([*FLY, "sede=1"]) == 2
        assert compose("config", ["+experiment=fly"]) == before
    assert (sys.argv, dict(os.environ)) == (arguments, environment)


def test_runs_of_an_interrupted_sweep_are_told_by_their_folders(monkeypatch, ran):
    def stop(_experiment, folder):
        (folder / artifacts.SUMMARY).parent.mkdir()
        raise KeyboardInterrupt

    use_stages(monkeypatch, record=stop)
    assert "2 runs of the sweep are left" in ran("-m", *FLY, "seed=1,2", "hydra.sweep.dir=s", code=130).err
