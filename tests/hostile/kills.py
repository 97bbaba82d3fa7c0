"""Kills runs at random moments or file operations, resumes them, and compares them with undisturbed ones."""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pipeline.command_line.runs import MISSED, OK, UNIMPROVED, UNPROVED
from pipeline.run import artifacts, lock, manifests, sweep
from tests import slurm

SMALL: Final = (
    *("duration_s=600", "optimizer.population_size=12", "optimizer.generations=12"),
    *("monte_carlo.num_cases=40", "telemetry.record_training=false"),
)
CHAMPION: Final = "+experiment=evaluate controller=paper_champion"
_TRAINED: Final = "stages=[scenario,train,evaluate]"
_SWEEP: Final = f"-m {CHAMPION} stages=[scenario,evaluate] seed=1,2,3"
_LAUNCHED: Final = f"-m +experiment=train_paper {_TRAINED} seed=1,2"
_WORDS: Final = {
    "genetic": "+experiment=train_paper stages=[scenario,train,evaluate,record]",
    "rounds": f"""+experiment=train_paper {_TRAINED} starts=random
        optimizer.rounds=3 optimizer.generations=4 optimizer.validation_cases=8""",
    "cma_es": f"""+experiment=train_planes {_TRAINED} starts.num_cases=8 starts.num_hard=0
        optimizer.rounds=1 optimizer.validation_cases=8""",
    "evaluate": f"{CHAMPION} stages=[scenario,evaluate,record]",
    "planned": "+experiment=evaluate controller=lqr stages=[scenario,evaluate,record]",
    "safety": """+experiment=evaluate controller=champion_any_sun safety=filter chief=tumbling
        stages=[scenario,evaluate]""",
    "search": f"""{CHAMPION} stages=[search] hparams_search.trials=10 hparams_search.num_cases=16
        hparams_search.block_cases=4 +hparams_search.space.deputy.max_force_n={{low:0.2,high:2.0}}""",
    "sweep": _SWEEP,
    **{name: f"{_LAUNCHED} hydra/launcher={name}" for name in ("basic", "joblib")},
    **{name: f"{_LAUNCHED} hydra/launcher={name}" for name in ("submitit_local", "submitit_slurm")},
    "parts": f"{CHAMPION} stages=[evaluate] engine.part_cases=7",
    "dask": f"""{CHAMPION} stages=[evaluate] engine.part_cases=200 monte_carlo.num_cases=8000 engine.kind=dask
        monte_carlo.workers=3""",
    "assure": """+experiment=assure controller=paper_champion assurance.num_cases=20 assurance.searches=1
        assurance.search_starts=8 assurance.search_population=6 assurance.search_generations=2
        assurance.domain_cases=8 duration_s=3600""",
    "optimum": """+experiment=optimum monte_carlo.num_cases=2 optimum.restarts=1 optimum.burns=2
        optimum.kicks=0""",
    "compare": """+experiment=reproduce stages=[compare] compare.controllers=[paper_champion,coast]
        compare.suns=[fixed] compare.safety=[none] monte_carlo.num_cases=10""",
    "fit": """+experiment=fit_mission fit.bases=[champion_27] fit.draws=1 fit.cases=[2,3] fit.kept=[1]
        fit.num_cases=3 fit.goal_percent=40 fit.neighbours=1 fit.planners=[] optimizer.population_size=6
        optimizer.generations=2 optimizer.rounds=1 monte_carlo.num_cases=3""",
    "prove": "+experiment=prove",
    "report": f"{CHAMPION} stages=[scenario,evaluate,record,report] monte_carlo.num_cases=10",
}
#: kinds of runs, small; a sweep begins with ``-m``
KINDS: Final[Mapping[str, Sequence[str]]] = {kind: words.split() for kind, words in _WORDS.items()}
SIGNALS: Final = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
#: who is signalled: the process, its whole group, or the workers of Dask that it started
PROCESS, GROUP, WORKERS = "process", "group", "workers"
TARGETS: Final[Mapping[str, Sequence[str]]] = {"dask": (PROCESS, GROUP, WORKERS)}
#: what makes a process end at one of its file operations
HOOK: Final = Path(__file__).with_name("hook")
#: of the process by which submitit watches local jobs: an interrupt of its group ends it with a traceback
CONTROLLER: Final = "submitit/local/_local.py"
#: longest time to an end that must come, s
LONGEST_S: Final = 1200.0


@dataclass
class Tally:
    """The results of the runs of a kind."""

    runs: int = 0
    kills: Counter[str] = field(default_factory=Counter)
    lost: list[str] = field(default_factory=list)
    different: list[str] = field(default_factory=list)


def command(words: Sequence[str]) -> list[str]:
    """Return the command line of the pipeline with some arguments."""
    return [sys.executable, "-m", "pipeline", *words]


def words_of(kind: str, folder: Path) -> list[str]:
    """Return the arguments that start a run of a kind; later ones take precedence."""
    chosen = KINDS[kind]
    given = {word.partition("=")[0] for word in chosen}
    # evidence has flights of its own
    given |= {"monte_carlo.num_cases"} if kind == "assure" else set()
    small = [word for word in SMALL if word.partition("=")[0] not in given]
    key = "hydra.sweep.dir" if chosen[0] == "-m" else "hydra.run.dir"
    return [*chosen, *small, f"{key}={folder}"]


def environment(**more: str) -> dict[str, str]:
    """Return the environment of a run, which may start in any folder."""
    path = os.pathsep.join(filter(None, [str(Path.cwd()), os.environ.get("PYTHONPATH", "")]))
    return {**os.environ, "PYTHONPATH": path, **more}


def environment_of(kind: str, root: Path) -> dict[str, str]:
    """Return the environment of a kind of run, with stand-ins for SLURM's commands if it needs them."""
    return environment(**(slurm.installed(root / "slurm") if kind == "submitit_slurm" else {}))


def hooked(env: Mapping[str, str], folder: Path, counts: Path, **more: object) -> dict[str, str]:
    """Return an environment in which processes count their file operations in a folder; see the hook."""
    path = os.pathsep.join(filter(None, [str(HOOK), env.get("PYTHONPATH", "")]))
    words = {name: str(value) for name, value in more.items()}
    return {**env, "PYTHONPATH": path, "KILL_UNDER": str(folder), "KILL_COUNTS": str(counts), **words}


def num_operations(counts: Path) -> int:
    """Return the file operations of the process that had most of them; none if nothing was counted."""
    lines = counts.read_text(encoding="utf-8").splitlines() if counts.exists() else []
    return max((int(line) for line in lines if line.isdigit()), default=0)


def run_alone(words: Sequence[str], env: Mapping[str, str], cwd: Path | None = None) -> float:
    """Run to the end, and return the duration in seconds."""
    started = time.perf_counter()
    subprocess.run(command(words), check=True, capture_output=True, env=env, cwd=cwd)  # noqa: S603
    return time.perf_counter() - started


def is_begun(folder: Path) -> bool:
    """Return whether a killed run, or sweep, can be resumed; before, its command is given again."""
    return folder.is_dir() and ((folder / sweep.SWEEP).exists() or artifacts.holds_run(folder))


def killed_after(
    words: Sequence[str], seconds: float, how: tuple[signal.Signals, str], env: Mapping[str, str], cwd: Path
) -> tuple[bool, int, str]:
    """Run until it ends or is signalled; return whether it was, its exit code and its last output.

    What does not end is killed, with exit code 0, and says so.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in the background: what is started inherits it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    with tempfile.TemporaryFile("w+") as stream:
        process = subprocess.Popen(  # noqa: S603
            command(words), stdout=subprocess.DEVNULL, stderr=stream, env=env, cwd=cwd, start_new_session=True
        )
        is_signalled = False
        try:
            with suppress(subprocess.TimeoutExpired):
                process.wait(seconds)
            if process.returncode is None:
                with suppress(ProcessLookupError):
                    is_signalled = _signal(process.pid, *how) > 0
            process.wait(LONGEST_S)
        except subprocess.TimeoutExpired:
            stream.write("\ndid not end")
        finally:
            with suppress(ProcessLookupError):  # what it has started, so that nothing keeps running
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        stream.seek(0)
        return is_signalled, process.returncode, stream.read()


def _signal(process: int, number: signal.Signals, target: str) -> int:
    """Send a signal to a process, its group or its workers; return to how many."""
    if target == GROUP:
        os.killpg(process, number)
        return 1
    ids = workers_of(process) if target == WORKERS else [process]
    for each in ids:
        os.kill(each, number)
    return len(ids)


def workers_of(process: int) -> list[int]:
    """Return the processes of Dask's workers that a process started."""
    workers = []
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # has ended meanwhile
            parent = int((path / "stat").read_text().rpartition(")")[2].split()[1])
            if parent == process and b"spawn_main" in (path / "cmdline").read_bytes():
                workers.append(int(path.name))
    return workers


def survive(
    kind: str,
    folder: Path,
    seconds: float,
    rng: random.Random,
    tally: Tally,
    root: Path,
    *,
    is_cold: bool = False,
    operations: int = 0,
) -> None:
    """Start a run, kill it once to three times, and let it finish; its folder may be relative to `root`.

    With a number of file operations it is killed at one of the first so many, else at some time.
    """
    left = rng.choice((1, 1, 2, 3))
    counts = root / "operations"
    tally.runs += 1
    with tempfile.TemporaryDirectory(prefix="kills-cache-") as cache:
        env = environment_of(kind, root) | ({"NUMBA_CACHE_DIR": cache} if is_cold else {})
        while True:
            words = [f"resume={folder}"] if is_begun(root / folder) else words_of(kind, folder)
            targets = (PROCESS, GROUP) if operations else TARGETS.get(kind, (PROCESS, GROUP))
            how = rng.choice(SIGNALS), rng.choice(targets)
            if how[1] == WORKERS:
                how = signal.SIGKILL, WORKERS
            at = ""
            if left > 0 and operations:
                counts.unlink(missing_ok=True)
                settings = {"KILL_AT": rng.randint(1, operations), "KILL_BY": int(how[0])}
                settings |= {"KILL_GROUP": ""} if how[1] == GROUP else {}
                at_operation = hooked(env, root / folder, counts, **settings)
                _, code, said = killed_after(words, LONGEST_S, how, at_operation, root)
                at = operation_of(counts)
                is_killed, left = bool(at), left - (not at)
            else:
                limit = rng.uniform(0.0, seconds * (3.0 if is_cold else 1.0)) if left > 0 else LONGEST_S
                is_killed, code, said = killed_after(words, limit, how, env, root)
            if said.endswith("did not end") or any(CONTROLLER not in text for text in tracebacks(said)):
                tally.lost.append(f"{kind} {folder.name}: {said.strip()[-300:]}")
                return
            if is_killed:
                left -= 1
                tally.kills[f"{how[0].name} {how[1]}{at}"] += 1
            if code in (OK, UNPROVED, UNIMPROVED, MISSED):
                while any(map(is_held, (root / folder).rglob(lock.LOCK))):  # by jobs of a killed launcher
                    time.sleep(1.0)
                return
            if how[1] == WORKERS and is_killed:
                tally.lost.append(f"{kind} {folder.name}: {said.strip().splitlines()[-1:]}")
                return
            if not is_killed and "is held by process" in said:
                time.sleep(1.0)  # jobs that a launcher started may outlive the command that was killed
                continue
            if not is_killed:
                tally.lost.append(f"{kind} {folder.name}: {said.strip().splitlines()[-1:]}")
                return


def tracebacks(said: str) -> list[str]:
    """Return the texts that begin with each traceback in what processes printed."""
    return said.split("Traceback (most recent call last)")[1:]


def is_held(path: Path) -> bool:
    """Return whether a process that is alive holds a lock."""
    try:
        return Path("/proc", str(json.loads(path.read_text(encoding="utf-8"))["process"])).exists()
    except (OSError, ValueError, LookupError):
        return False


def operation_of(counts: Path) -> str:
    """Return at which operation a process was killed, in words; empty if none was."""
    lines = counts.read_text(encoding="utf-8").splitlines() if counts.exists() else []
    return next((f" at {line.split()[1]}" for line in lines if line.startswith("killed")), "")


def differences(folder: Path, other: Path) -> list[str]:
    """Return the files in which two finished runs, or sweeps, differ, and what a killed one left lying."""
    # how a run ended that did not improve or prove stays with it
    left = [path.name for path in folder.rglob(".*") if path.name != sweep.ENDING]
    if not (other / sweep.SWEEP).exists():
        return [*_differences(folder, other), *left]
    names = [run.folder for run in sweep.read(other)]
    if names != [run.folder for run in sweep.read(folder)]:
        return [sweep.SWEEP]
    return [
        *(
            f"{name}/{name_of_file}"
            for name in names
            for name_of_file in _differences(folder / name, other / name)
        ),
        *left,
    ]


def _differences(folder: Path, other: Path) -> list[str]:
    first, two = (manifests.read(side) for side in (folder, other))
    if first["finished_stages"] != two["finished_stages"]:
        return ["finished_stages"]
    names = sorted({*first["sha256"], *two["sha256"]})
    unlike = [name for name in names if first["sha256"].get(name) != two["sha256"].get(name)]
    stale = [name for name, digest in first["sha256"].items() if artifacts.file_hash(folder / name) != digest]
    return [*unlike, *stale]


def verify_survives(folder: Path, seconds: float, rng: random.Random, tally: Tally, root: Path) -> None:
    """Kill the checking of a finished run: nothing there changes, and it can be checked."""

    def held() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in (root / folder).rglob("*") if path.is_file()}

    words, before = ["verify", str(folder)], held()
    how = rng.choice(SIGNALS), rng.choice((PROCESS, GROUP))
    is_killed, _, _ = killed_after(words, rng.uniform(0.0, seconds), how, environment(), root)
    tally.runs += 1
    tally.kills[f"{how[0].name} {how[1]}"] += is_killed
    if before != (after := held()):
        tally.different.append(f"verify: {', '.join(str(path) for path in before.keys() ^ after.keys())}")
    _, code, said = killed_after(words, LONGEST_S, how, environment(), root)
    if code:
        tally.lost.append(f"verify: {said.strip()[-300:]}")
