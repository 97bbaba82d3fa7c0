"""What every test runs under: all tests share the processors among processes, and each knows its share."""

import gc
import os
import pickle
import signal
from typing import IO, Any

import pytest
from omegaconf import OmegaConf

from pipeline.command_line.cli import main
from tests import compositions, selection
from tests.browser import axe, browser, opened
from tests.commands import running
from tests.durations import Recorder
from tests.editors import open_page, window

# fixtures for all tests: a process runs one browser
__all__ = ["axe", "browser", "open_page", "opened", "window"]

#: Read by BLAS and OpenMP when they are loaded, and by the commands that tests start.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

#: Each imports everything, so more of them would spend their time on that.
MOST_PROCESSES = 8

# numba colours the errors by which it finds out which overload fits, also where nobody sees them
os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")

if "PYTEST_XDIST_WORKER" in os.environ:
    share = max(1, (os.cpu_count() or 1) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"]))
    os.environ.update(dict.fromkeys(THREADS, str(share)))
    # what takes one thread a processor unless it is told otherwise, as flights and inference do
    os.sched_getaffinity = lambda _: set(range(share))


# what modules and compilers hold is looked through for garbage a tenth as often
gc.set_threshold(50_000, 20, 10)

#: what was read for Hydra, by the text that it was read from
_read: dict[str, bytes] = {}


def _load(file: IO[str], load: Any = OmegaConf.load) -> Any:
    """Read a configuration file for Hydra, which reads forty each time; a text is parsed but once."""
    text = file.read()
    if text not in _read:
        file.seek(0)
        _read[text] = pickle.dumps(load(file))
    return pickle.loads(_read[text])  # noqa: S301 - our own


OmegaConf.load = staticmethod(_load)  # type: ignore[method-assign, assignment]
compositions.make_once()


pytest_addoption = selection.add_options
pytest_collection_modifyitems = selection.select


def pytest_configure(config: pytest.Config) -> None:
    """Take the plan of the process that started this one, and heed the keyboard, as tests of it do.

    A shell's background job ignores it, and so would what tests start.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.option.record:
        config.pluginmanager.register(Recorder())
    if hasattr(config, "workerinput"):
        config.stash[selection.PLAN] = selection.Plan(*config.workerinput["plan"])


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Give each process the plan."""
    node.workerinput["plan"] = list(node.config.stash[selection.PLAN])


def pytest_report_header(config: pytest.Config) -> str:
    """Say which tests are run, where nobody named them."""
    return config.stash[selection.PLAN].heading


def pytest_runtest_setup(item: pytest.Item) -> None:
    """End a run of one minute in time."""
    selection.skip_after_a_minute(item.config)


def pytest_collection_finish() -> None:
    """Keep what is loaded, and thousands of tests, out of every later search for garbage."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def ran(capsys):
    """Run a command of the pipeline, see `running`."""
    return running(main, capsys)


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> int | None:
    """Plan a run; one of many tests takes all processors, named files and what is debugged one without -n.

    Neighbours stay together, so that a module's fixtures are seldom made twice; a process that has nothing
    left to do takes over half of what another has before it. The tests of `--changed` start in their order.
    """
    option = config.option
    if hasattr(config, "workerinput"):
        return None
    has_processes = config.pluginmanager.hasplugin("xdist")
    is_whole = config.args_source == pytest.Config.ArgsSource.TESTPATHS
    if (
        has_processes
        and option.numprocesses is None
        and is_whole
        and not (option.usepdb or option.collectonly)
    ):
        option.numprocesses = min(os.cpu_count() or 1, MOST_PROCESSES)
    num_processes = getattr(option, "numprocesses", None) or 1
    plan = config.stash[selection.PLAN] = selection.planned(config, num_processes)
    if plan.way == "changed":
        if not plan.chosen:
            print("no file differs that a test can reach; --all takes all tests")  # noqa: T201
            return 0
        config.args = list(plan.chosen)
    if has_processes and option.numprocesses and option.dist == "no":
        option.dist = "load" if plan.way == "changed" else "worksteal"
        option.maxschedchunk = 2 if plan.way == "changed" else None
    return None
