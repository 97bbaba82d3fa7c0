"""Options and overrides, in whatever order, and sweeps multiplied out."""

from pathlib import Path

import pytest

from pipeline.command_line.arguments import read_arguments
from pipeline.command_line.config import compose_jobs
from pipeline.command_line.overrides import (
    ConfigError,
    check_sweeps,
    differences_of,
    folder_names,
    parse,
    rewrite_paths,
    single_runs,
)

GROUPS = {"sun": ["fixed", "mixed", "random"]}


def test_options_stand_anywhere() -> None:
    asked = read_arguments(["seed=1", "-m", "name=a b", "--cfg", "job", "resume=x", "+experiment=fly"])
    assert asked.overrides == ("seed=1", "name=a b", "+experiment=fly")
    assert (asked.multirun, asked.cfg, asked.resume, asked.help) == (True, "job", Path("x"), False)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--cfg", "jo"], "invalid choice: 'jo'"),
        (["seed=1", "--config-dir"], "expected one argument"),
        (["-x"], "there is no option -x"),
        (["--multi"], "there is no option --multi; did you mean --multirun?"),
    ],
)
def test_options_that_are_none(words: list[str], told: str) -> None:
    with pytest.raises(ConfigError, match=told.replace("?", r"\?")):
        read_arguments(words)


def test_a_sweep_is_every_value_with_every_other() -> None:
    runs = single_runs(parse(["seed=1,2", "name=x", "sun=glob(*,exclude=m*)"]), GROUPS)
    expected = [["seed=1", "name=x", "sun=fixed"], ["seed=1", "name=x", "sun=random"]]
    assert list(runs) == [*expected, *[["seed=2", *words[1:]] for words in expected]]
    assert list(single_runs(parse(["seed=range(1,3)"]), {})) == [["seed=1"], ["seed=2"]]


def test_folders_of_a_sweep_are_named_by_what_differs() -> None:
    words = [
        "+experiment=evaluate",
        "seed=1,2",
        "controller=x/a b.json,y/a b.json",
        "monte_carlo.num_cases=9",
    ]
    differing = differences_of(parse(rewrite_paths(words)), {})
    assert differing[1] == {"seed": "1", "controller": "y/a b.json"}
    assert len(differing) == len(list(single_runs(parse(rewrite_paths(words)), {}))) == 4
    names = folder_names(differing)
    assert names[0] == "seed=1+controller=a-b.json"
    assert len(set(names)) == 4  # also those whose words are the same
    assert folder_names([{}]) == ["0"]
    assert rewrite_paths(["hydra.run.dir=out/seed=1"]) == ["hydra.run.dir='out/seed=1'"]


def test_two_runs_are_compared_by_their_folders() -> None:
    asked = read_arguments(["compare=outputs/a,outputs/b"])
    assert asked.compare == (Path("outputs/a"), Path("outputs/b"))
    assert read_arguments(["compare=default"]).compare is None
    with pytest.raises(ConfigError, match="takes nothing else"):
        read_arguments(["compare=a,b", "seed=1"])


def test_an_interval_is_no_sweep() -> None:
    with pytest.raises(ConfigError, match=r"seed=interval\(1,2\) is an interval"):
        check_sweeps(parse(["seed=interval(1,2)"]), is_multirun=True)


def test_the_runs_of_a_sweep_lie_side_by_side() -> None:
    words = ["+experiment=fly", "controller=coast"]
    one, other = compose_jobs([[*words, "seed=1"], [*words, "seed=2"]], names=["seed=1", "a b"])
    assert one.folder.parent == other.folder.parent
    assert one.folder.parts[:2] == ("outputs", "fly-sweep")
    assert (one.folder.name, other.folder.name) == ("seed=1", "a b")
    assert one.sweep_folder == one.folder.parent
    (alone,) = compose_jobs([[*words, "hydra.run.dir=a/b"]])
    assert alone.folder == Path("a/b")
    assert "hydra" not in alone.config
