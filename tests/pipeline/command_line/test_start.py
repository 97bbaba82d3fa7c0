"""How the command starts: quickly, from any folder, installed or not."""

import re
import tomllib
from importlib import metadata
from pathlib import Path
from subprocess import CompletedProcess

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from fis_tools.compiled.notice import WARMING
from fis_tools.formats import serialize
from pipeline.command_line import choices, cli, commands, overrides
from pipeline.command_line.arguments import parse_arguments
from pipeline.command_line.config import compose_experiment, conf_folder
from pipeline.command_line.guide import TEMPLATE
from pipeline.flight.state.signals import SIGNALS
from pipeline.run import maker
from pipeline.settings.keys import value_at
from tests.pipeline.command_line.cases import FLY
from tests.programs import run_python

HEAVY = ["numpy", "numba", "sklearn", "matplotlib", "deap", "pyarrow", "rerun", "mcap", "skfuzzy"]
HEAVY += ["pipeline.flight.fly.many"]


def test_a_mistake_and_a_flight_load_no_more_than_they_need(tmp_path):
    """A mistake nothing heavy; a flight neither SciPy nor tables nor readers of other programs.

    What evaluates and reports flights, and compiles none, loads neither numba nor searches.
    """
    code = f"""
import sys
from pipeline.command_line.cli import main
print(main(["+experiment=fly", "sede=3"]), [name for name in {HEAVY} if name in sys.modules])
import pipeline.controllers.source, pipeline.stages.record
unused = ("scipy", "pyarrow", "fis_tools.formats.exchange.dialect")
print([name for name in unused if name in sys.modules])
import pipeline.stages.evaluate, pipeline.stages.report
from pipeline.run.maker import present_maker
print(len(present_maker()), [name for name in ("numba", "deap") if name in sys.modules])
"""
    assert run_python("-c", code, folder=tmp_path).stdout == "2 []\n[]\n4 []\n"


def test_the_help_loads_no_library_but_what_checks_settings_and_reads_yaml(tmp_path):
    """Hydra, whose options stand in it, takes as long to load as all else."""
    code = """
import sys
before = set(sys.modules)
from pipeline.__main__ import main
main(["--help"])
files = {name: getattr(sys.modules[name], "__file__", None) or "" for name in set(sys.modules) - before}
print("loaded:", *{name.partition(".")[0] for name, file in files.items() if "-packages" in file})
"""
    (line,) = re.findall("^loaded: (.*)$", run_python("-c", code, folder=tmp_path).stdout, re.MULTILINE)
    needed = map(metadata.distribution, with_dependencies("pydantic") | {"pyyaml"})
    there = {path.parts[0].partition(".")[0] for each in needed for path in each.files or ()}
    assert set(line.split()) <= there


def with_dependencies(name: str) -> set[str]:
    """Return a distribution with all that it requires, without its extras, by their canonical names."""
    required = [Requirement(text) for text in metadata.requires(name) or ()]
    needed = {each.name for each in required if each.marker is None or each.marker.evaluate({"extra": ""})}
    return {canonicalize_name(name)}.union(*map(with_dependencies, needed))


def test_ctrl_c_while_the_program_is_loaded_ends_in_a_sentence(tmp_path):
    code = """
import sys
from pipeline.__main__ import main
class Stopping:
    def find_spec(self, name, path, target=None):
        if name == "hydra": raise KeyboardInterrupt
sys.meta_path.insert(0, Stopping())
sys.exit(main(["+experiment=fly"]))
"""
    done = run_python("-c", code, folder=tmp_path, code=130)
    assert "nothing to keep" in done.stderr.strip().splitlines()[-1]


def test_to_warm_experiments_are_compiled_at_once_in_new_folders_and_a_failure_ends_it(monkeypatch, ran):
    started, codes = [], [0] * len(commands.WARMED) + [2]

    def run(command, env, **_):
        assert env[WARMING] == "1"
        started.append(command)
        return CompletedProcess(command, codes[len(started) - 1])

    monkeypatch.setattr(commands.subprocess, "run", run)
    assert cli.main(["warm"]) == 0
    assert len({command[-1] for command in started}) == len(commands.WARMED)
    assert [command[3:-1] for command in started] == [list(words) for words in commands.WARMED]
    for words in commands.WARMED:
        assert compose_experiment(list(words)).experiment.stages
    assert cli.main(["warm"]) == 2
    assert (
        "error: unrecognized arguments: champion_27; see python -m pipeline warm --help"
        in ran("warm", "champion_27", code=2).err
    )


@pytest.mark.parametrize(("arguments", "code"), [([], 2), (["--help"], 0), (["-h"], 0)])
def test_help_lists_experiments_controllers_and_signals(arguments, code, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == code
    text = capsys.readouterr().out
    groups = choices.options([conf_folder()])
    for name in (*groups["experiment"], *groups["controller"]):
        # each with a sentence behind it
        assert re.search(rf"^  {re.escape(name)} +\S.*\.?$", text, re.MULTILINE), name
    for name, signal in SIGNALS.items():
        assert re.search(rf"^  {name} +\[{re.escape(signal.unit)}\] \w", text, re.MULTILINE), name
    assert "random" in text
    assert list(tmp_path.iterdir()) == []


def test_controllers_that_searches_start_from_are_listed_apart(ran):
    files = (conf_folder() / "controller").glob("*.yaml")
    fuzzy = [serialize.load(path) for path in files if "\nsystems:" in path.read_text(encoding="utf-8")]
    starts = {each.name for each in fuzzy if f'purpose: "{each.purpose}'.startswith(TEMPLATE)}
    _, flown, apart, _ = re.split(r"^controllers |^signals ", ran("--help").out, flags=re.MULTILINE)
    assert set(re.findall(r"^  (\w+)", apart, re.MULTILINE)) == starts != set()
    assert {each.name for each in fuzzy} - starts <= set(re.findall(r"^  (\w+)", flown, re.MULTILINE))
    for experiment, are_named in (("train", True), ("evaluate", False)):
        choices = re.search(r"controller=NAME\n +One of (.*)\.", ran("--help", experiment).out)[1].split(", ")
        assert (starts <= set(choices)) == are_named == (not starts.isdisjoint(choices))


def test_help_on_a_group_a_key_and_what_is_no_key(ran):
    assert "  safety.braking_force_n=null N\n      Greatest force along each" in ran("--help", "safety").out
    printed = ran("--help", "sun.mode", "seed").out
    assert "(fixed, random, mixed)" in printed
    assert "  seed=1\n" in printed
    assert "did you mean deputy.mass_kg?" in ran("--help", "deputy.mass", code=2).err


@pytest.mark.parametrize("words", [["--help", "train_polish"], ["+experiment=train_polish", "--help"]])
def test_help_on_an_experiment_shows_what_people_change_with_its_values(words, ran):
    printed = ran(*words).out
    assert printed.startswith("+experiment=train_polish: Polish all but the rules")
    shown = re.findall(r"^  ([\w.]+)=(.*)$", printed, re.MULTILINE)
    assert len(shown) == 11  # the stages, and ten keys or groups
    composed = compose_experiment(["+experiment=train_polish", "controller=champion_27"]).config
    values = {key: yaml.safe_load(value) for key, value in shown if value != "NAME"}
    assert values == {key: value_at(composed, key) for key in values}
    assert "optimizer.population_size" in values
    assert "assurance.num_cases" not in values


def test_name_and_version_are_the_projects(ran):
    project = tomllib.loads((maker.SOURCES / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert ran("--version").out == f"{project['name']} {project['version']}\n"


def test_options_stand_anywhere() -> None:
    command = parse_arguments(["seed=1", "-m", "name=a b", "--cfg", "job", "resume=x", "+experiment=fly"])
    assert command.overrides == ["seed=1", "name=a b", "+experiment=fly"]
    assert (command.multirun, command.cfg, command.resume, command.help) == (True, "job", Path("x"), False)
    assert command.hydra_options == ["-m", "--cfg", "job"]


def test_paths_and_folders_are_quoted_for_the_grammar() -> None:
    words = ["controller=x/a b.json,y/a b.json", "hydra.run.dir=out/seed=1"]
    paths = ["controller=file", "controller.path='x/a b.json','y/a b.json'"]
    assert overrides.rewrite_paths(words) == [*paths, "hydra.run.dir='out/seed=1'"]
    outside = ["hydra.run.dir=Läufe (2)", "hydra.sweep.dir=a,b", "hydra.run.dir=~/#1"]
    home = Path("~/#1").expanduser()
    assert overrides.rewrite_paths(outside) == [
        "hydra.run.dir='Läufe (2)'",
        outside[1],
        f"hydra.run.dir='{home}'",
    ]
    with pytest.raises(overrides.ConfigError, match=r"seed=interval\(1,2\) is an interval"):
        overrides.check_sweeps(overrides.parse(["seed=interval(1,2)"]), "")


def test_two_runs_are_compared_by_their_folders(ran) -> None:
    for words, message in (
        (["compare=outputs/a,b"], "outputs/a is no folder"),
        (["compare=a,b", "seed=1"], "compare takes 2 to 8 folders and nothing else, and 3 words are given"),
        (["compare=a,b,c,d,e,f,g,h,i"], "compare takes 2 to 8 folders"),
        (["summary"], "summary takes 1 folder and nothing else, and 0 words are given"),
        (["verify", "a", "b", "c"], "verify takes 1 or 2 folders"),
        (["compare=default"], "no experiment is chosen"),
    ):
        assert message in ran(*words, code=2).err


def test_the_folder_of_a_run_is_no_part_of_its_configuration() -> None:
    job = compose_experiment([*FLY, "hydra.run.dir=a/b"])
    assert job.folder == Path("a/b")
    assert "hydra" not in job.config
