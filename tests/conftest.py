"""What every test runs under: all tests share the processors among processes, and each knows its share."""

import os

import pytest

from fis_tools.engines import cache

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
    os.cpu_count = lambda: share


# flights of nearly every kind are flown more than once here: none is worth flying as plain Python first
cache.was_asked = lambda *_: True


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Run all tests on all processors; named files, and what is debugged, stay in one process without -n.

    Neighbours stay together, so that a module's fixtures are seldom made twice; a process that has nothing
    left to do takes over half of what another has before it.
    """
    option = config.option
    if "PYTEST_XDIST_WORKER" in os.environ or not config.pluginmanager.hasplugin("xdist"):
        return
    is_whole = config.args_source == pytest.Config.ArgsSource.TESTPATHS
    if option.numprocesses is None and is_whole and not (option.usepdb or option.collectonly):
        option.numprocesses = min(os.cpu_count() or 1, MOST_PROCESSES)
    if option.numprocesses and option.dist == "no":
        option.dist = "worksteal"
