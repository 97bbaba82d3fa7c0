"""Build the shipped machine code again: ``python -m benchmarks objects`` compares it with what is shipped.

Each of `commands` is run with nothing compiled, as a processor of each family would run it; what numba
compiles for it is made an object. With ``--write`` they are shipped. The same source, numba and llvmlite give
the same bytes. ``--write --changed`` builds those whose source is another now, and keeps the others.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.scaling import words_of
from fis_tools.compiled.shipped import load
from pipeline.command_line.commands import SMALL
from pipeline.settings.places import conf_folder

FEW = ("stages=[scenario,evaluate]", "monte_carlo.num_cases=8")
EXAMPLES = Path(__file__).parents[1] / "docs" / "examples"
#: What should wait for no compiler, as words after ``python -m fis_tools``: README's commands.
TOOLKIT: tuple[tuple[str, ...], ...] = (
    ("review", str(EXAMPLES / "dimmer.fll"), "-o", "{scratch}/dimmer.html"),
    ("audit", str(EXAMPLES / "tipper.fis")),
    (
        *("bounds", str(EXAMPLES / "pendulum.yaml")),
        *("--where", "angle > 0.2, angular_velocity > 0", "--ask", "force < 0"),
    ),
)
#: By the family that numba compiles for, those whose objects are made of it.
MADE = {"x86-64-v4": ("x86-64-v4",), "x86-64-v3": ("x86-64-v3", "aarch64")}
#: Environments that are not registered, or registered by what they are made of.
OTHERS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("MultiInspection", {}),
    ("Inspection-v0", {"overrides": ["world=afrl"]}),
    ("Inspection-v0", {"overrides": ["world=leo"]}),
    ("MultiInspection", {"overrides": ["world=paper"]}),
    ("MultiInspection", {"overrides": ["world=leo"]}),
)
RECORDED = ("stages=[scenario,evaluate,record]", "monte_carlo.num_cases=8")
#: each flight with a mass of its own, which fly fewer side by side
MASSES = ("+dispersions.deputy.mass_kg={kind:normal,mean:12.0,std:0.5}",)
APART = ("safety=robust", "fleet.keep_apart_m=10", "navigation=fixes", "actuators=real")
WAY_OUT = ("safety=filter", "safety.keep_way_out=true", "monte_carlo.max_distance_m=94")


def commands() -> list[tuple[str, ...]]:
    """Return what should wait for no compiler, as words after ``python -m pipeline``.

    README's commands, a tutorial's, each champion in its world, and flights of other structures that pages
    tell of: with errors, around a chief that hides parts of itself, with a mass each, with the camera kept
    out of the Sun, of fleets.
    """
    evaluate = ("+experiment=evaluate", "controller=champion_27")
    fleet = ("+experiment=evaluate_fleet", "controller=champion_27", "sun=random")
    planning = ("+experiment=evaluate_fleet", "controller=champion_27_rehearsed", "sun=random")
    champions = sorted(path.stem for path in (conf_folder() / "controller").glob("*champion*.yaml"))
    return [
        ("+experiment=evaluate", "controller=champion_27", "monte_carlo.num_cases=20"),
        ("+experiment=train", "stages=[scenario,train]", *SMALL),
        ("+experiment=evaluate", "controller=champion_27", "safety=robust", *FEW),
        ("+experiment=evaluate", "controller=paper_champion", "safety=filter", *FEW),
        *(("+experiment=evaluate", *words_of(name), *RECORDED) for name in champions),
        (*evaluate, "navigation=fixes", "actuators=real", *RECORDED),
        (*evaluate, "chief=satellite", *RECORDED),
        (*evaluate, "guidance=clusters", *FEW),
        (*evaluate, *MASSES, "stages=[scenario,evaluate]", "monte_carlo.num_cases=10"),
        (*evaluate, *WAY_OUT, *FEW),
        ("+experiment=evaluate", "controller=natural_motion", *FEW),
        (*fleet, *RECORDED),
        (*fleet, "safety=filter", "fleet.keep_apart_m=10", *RECORDED),
        (*fleet, *APART, *FEW),
        (*planning, *RECORDED),
        (*planning, "navigation=fixes", "actuators=real", *RECORDED),
        (*planning, *APART, *RECORDED),
        (*evaluate, "safety=filter", "safety.min_sun_angle_deg=30", *RECORDED),
        ("+experiment=evaluate_fleet", "controller=champion_any_sun", "world=leo", *FEW),
        ("+experiment=evaluate_fleet", "controller=champion_leo", "world=leo", *RECORDED),
    ]


def environments() -> list[tuple[str, dict[str, Any]]]:
    """Return the environments whose first step should wait for no compiler, with what they are made of."""
    import gymnasium  # noqa: PLC0415 - as in build

    import pipeline.gym  # noqa: F401, PLC0415 - registers them

    specs = gymnasium.registry.values()
    ours = [spec.id for spec in specs if str(spec.entry_point).startswith("pipeline.gym")]
    return [*((name, {}) for name in ours), *OTHERS]


def main(arguments: Sequence[str]) -> int:
    """Return 1 if what is built is not what is shipped."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks objects", description=__doc__)
    parser.add_argument("--write", action="store_true", help="ship what is built")
    parser.add_argument("--changed", action="store_true", help="build what has another source than shipped")
    parser.add_argument("--family", choices=tuple(MADE), action="append", help="this one alone")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.into:
        build(options.into, options.family[0])
        return 0
    with tempfile.TemporaryDirectory(prefix="objects-") as scratch:
        folder = Path(scratch)
        # side by side: each keeps one processor busy most of the time
        with ThreadPoolExecutor() as pool:
            list(pool.map(partial(run, folder, options.changed), options.family or MADE))
        if options.write:
            ship(folder)
            return 0
        return compare(folder)


def run(folder: Path, is_changed: bool, family: str) -> None:
    """Build the objects of a family in a process of its own, which takes itself for one of its processors."""
    environment = os.environ | {
        **{"NUMBA_CPU_NAME": family, "NUMBA_CPU_FEATURES": "", load.SWITCH: str(int(is_changed))},
        "NUMBA_CACHE_DIR": str(folder / "cache" / family),
    }
    command = [sys.executable, "-m", "benchmarks", "objects", "--family", family, "--into", str(folder)]
    subprocess.run(command, check=True, env=environment)  # noqa: S603


def build(folder: Path, family: str) -> None:
    """Run all calls, and write an object of each function that numba compiles for them, with its facts."""
    from fis_tools.__main__ import main as run_toolkit  # noqa: PLC0415 - as below
    from fis_tools.compiled.fingerprint import functions_of  # noqa: PLC0415 - as below
    from fis_tools.compiled.shipped import build as objects  # noqa: PLC0415 - it imports numba
    from fis_tools.compiled.shipped.identity import digest, facts_of  # noqa: PLC0415
    from pipeline.__main__ import main as run_pipeline  # noqa: PLC0415

    with noting() as calls, tempfile.TemporaryDirectory() as scratch:
        for words in TOOLKIT:
            print(f"{family}: {' '.join(words)}", file=sys.stderr, flush=True)
            if code := run_toolkit([word.replace("{scratch}", scratch) for word in words]):
                raise SystemExit(code)
        for name, options in environments():
            print(f"{family}: {name}", file=sys.stderr, flush=True)
            step_once(name, options)
        for number, words in enumerate(commands()):
            print(f"{family}: {' '.join(words)}", file=sys.stderr, flush=True)
            if code := run_pipeline([*words, f"hydra.run.dir={scratch}/{number}"]):
                raise SystemExit(code)
    for (compiled, types), (kinds, _) in calls.items():
        overload = compiled.dispatcher.overloads.get(kinds)
        function = compiled.py_func
        name = f"{function.__module__}.{function.__qualname__}"
        key = objects.sha256(types.encode())[:16]
        held = load.index()["functions"].get(name, {}).get(key)
        if overload is None and held is None:
            continue
        source = digest(compiled, {})
        try:
            if overload is not None:
                result = objects.result_kind(overload.signature.return_type)
                parts = overload.library.get_llvm_str(), overload.fndesc.llvm_func_name
                made = {
                    each: objects.packed(objects.object_of(*parts, kinds, each, returns=bool(result)))
                    for each in MADE[family]
                }
            elif held["digest"] == source:
                result, files = held.get("result", ""), held["families"]
                made = {each: (load.CODE / each / files[each]["name"]).read_bytes() for each in MADE[family]}
            else:
                continue
        except objects.NotShippedError as error:
            print(f"  {name} is not shipped: {error}", file=sys.stderr)
            continue
        facts = {
            "function": name,
            "types": key,
            "digest": source,
            "result": result,
            "modules": facts_of(iter(functions_of(compiled))),
        }
        for each, packed in made.items():
            file = folder / each / f"{name.rpartition('.')[2].lstrip('_')}-{key}.o.xz"
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(packed)
            about = {"family": each, "file": {"name": file.name, "sha256": objects.sha256(packed)}}
            (folder / f"{each}-{file.name}.json").write_text(json.dumps(facts | about), encoding="utf-8")


def step_once(name: str, options: dict[str, Any]) -> None:
    """Take a step in an environment, and in several of them."""
    import gymnasium  # noqa: PLC0415 - as in build

    if name == "MultiInspection":
        from pipeline.gym.parallel import MultiInspectionEnv  # noqa: PLC0415 - as in build

        fleet = MultiInspectionEnv(**options)
        fleet.reset(seed=1)
        fleet.step({agent: fleet.action_space(agent).sample() for agent in fleet.agents})
        return
    for made in (
        gymnasium.make(f"pipeline.gym:{name}", **options),
        gymnasium.make_vec(f"pipeline.gym:{name}", 2, **options),
    ):
        made.reset(seed=1)
        made.step(made.action_space.sample())
        made.close()


@contextmanager
def noting() -> Iterator[dict[tuple[Any, str], tuple[Any, Any]]]:
    """Note which compiled functions are called inside, with the types of their arguments."""
    import numba  # noqa: PLC0415

    from fis_tools.compiled.decorator import Compiled  # noqa: PLC0415
    from fis_tools.compiled.shipped.arguments import UnknownArgumentError, signature  # noqa: PLC0415

    calls: dict[tuple[Any, str], tuple[Any, Any]] = {}
    plain_call, plain_prepared = Compiled.__call__, Compiled.prepared

    def note(compiled: Any, args: tuple[Any, ...]) -> None:
        try:
            types = signature(args)
        except UnknownArgumentError:
            return
        if (compiled, types) not in calls:
            calls[compiled, types] = tuple(map(numba.typeof, args)), None

    def call(self: Any, *args: Any, **kwargs: Any) -> Any:
        if not kwargs:
            note(self, args)
        return plain_call(self, *args, **kwargs)

    def prepared(self: Any, *args: Any) -> Any:
        note(self, args)
        return plain_prepared(self, *args)

    Compiled.__call__, Compiled.prepared = call, prepared  # type: ignore[method-assign]
    try:
        yield calls
    finally:
        Compiled.__call__, Compiled.prepared = plain_call, plain_prepared  # type: ignore[method-assign]


def indexed(folder: Path) -> dict[str, Any]:
    """Return the index of what was built."""
    functions: dict[str, Any] = {}
    modules: dict[str, Any] = {}
    for path in sorted(folder.glob("*.json")):
        facts = json.loads(path.read_text(encoding="utf-8"))
        held = functions.setdefault(facts["function"], {})
        entry = held.setdefault(facts["types"], {"digest": facts["digest"], "families": {}})
        entry["families"][facts["family"]] = facts["file"]
        entry |= {"result": facts["result"]} if facts["result"] else {}
        for name, module in facts["modules"].items():
            held_module = modules.setdefault(name, {"sha256": module["sha256"], "functions": {}})
            held_module["functions"] |= module["functions"]
    return {"functions": dict(sorted(functions.items())), "modules": dict(sorted(modules.items()))}


def ship(folder: Path) -> None:
    """Put what was built in the place of what is shipped."""
    for old in load.CODE.rglob("*.xz"):
        old.unlink()
    for new in folder.rglob("*.xz"):
        target = load.CODE / new.relative_to(folder)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(new.read_bytes())
    text = json.dumps(indexed(folder), indent=1, sort_keys=True) + "\n"
    load.INDEX.write_text(text, encoding="utf-8")
    sizes = [path.stat().st_size for path in load.CODE.rglob("*.xz")]
    print(f"{len(sizes)} objects, {sum(sizes) / 1000:.0f} kB")


def compare(folder: Path) -> int:
    """Print what is built otherwise than it is shipped; return 1 if something is."""
    differing = 0
    for path in sorted(folder.rglob("*.xz")):
        name = path.relative_to(folder)
        shipped = load.CODE / name
        same = shipped.exists() and shipped.read_bytes() == path.read_bytes()
        differing += not same
        print(f"{name}: {'the same bytes' if same else 'other bytes than shipped'}")
    return int(differing > 0)
