"""A run is composed once, as Hydra composes it when it composes twice."""

from contextlib import nullcontext

import pytest
from hydra import initialize_config_dir
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.global_hydra import GlobalHydra
from hydra.types import RunMode
from omegaconf import OmegaConf

from pipeline.command_line.config import COMPOSED_FROM, hydra_apart
from pipeline.command_line.hydra_parts import composing_once

RUN = ("+experiment=evaluate", "controller=champion_27", "seed=3")
SWEEP = "+experiment=a_sweep"


def composed(words, multirun, once):
    """Return the mode that Hydra reads, and what it then composes, as `_run_app` of Hydra asks for both."""
    folder, name, version = COMPOSED_FROM
    block = composing_once() if once else nullcontext()
    with hydra_apart(), block, initialize_config_dir(folder, version_base=version):
        hydra, words = GlobalHydra.instance().hydra, list(words)
        mode = hydra.get_mode(name, words)
        started = RunMode.MULTIRUN if multirun else mode or RunMode.RUN
        if mode is None or mode != started:
            words.append(f"hydra.mode={started.name}")
        config = hydra.compose_config(name, words, started)
        if started == RunMode.RUN:
            config.hydra.mode = RunMode.RUN  # as `Hydra.run` does
        return mode, OmegaConf.to_container(config, enum_to_str=True)


@pytest.fixture
def in_sweeps(tmp_path):
    """An experiment whose file makes it a sweep."""
    path = tmp_path / "experiment" / "a_sweep.yaml"
    path.parent.mkdir()
    path.write_text("# @package _global_\nname: a_sweep\nstages: [scenario]\nhydra:\n  mode: MULTIRUN\n")
    return f"hydra.searchpath=[file://{tmp_path}]"


@pytest.mark.parametrize(
    ("words", "multirun", "times"),
    [
        (RUN, False, 1),
        ((*RUN, "hydra.mode=RUN"), False, 3),
        ((*RUN, "hydra.mode=MULTIRUN", "seed=1,2"), False, 2),
        ((*RUN, "seed=1,2"), True, 2),
        (RUN, True, 2),
        ((SWEEP,), False, 3),
    ],
)
def test_a_run_is_composed_once_and_what_hydra_composes_stays(words, multirun, times, in_sweeps, monkeypatch):
    counted, compose = [], ConfigLoaderImpl._compose_config_from_defaults_list

    def counting(self, **given):
        counted.append(1)
        return compose(self, **given)

    words = (*words, in_sweeps)
    expected = composed(words, multirun, once=False)
    monkeypatch.setattr(ConfigLoaderImpl, "_compose_config_from_defaults_list", counting)
    assert composed(words, multirun, once=True) == expected
    assert len(counted) == times


def test_what_cannot_be_composed_is_refused_as_by_hydra():
    for words in (("+experiment=no_such",), (*RUN, "no_such_key=1"), ("controller=${no_such}",)):
        with pytest.raises(Exception) as plain:  # noqa: PT011 - compared below
            composed(words, multirun=False, once=False)
        with pytest.raises(type(plain.value)) as once:
            composed(words, multirun=False, once=True)
        assert str(once.value) == str(plain.value)
