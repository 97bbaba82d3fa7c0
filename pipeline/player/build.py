"""Build the modules of the player: ``python -m pipeline.player.build [plain] [erring] [lit]``.

It needs ``wasm-ld`` (``apt install lld-19``) and ``wasm-opt`` of binaryen 132 or later (``npm install
binaryen``) on the path; whoever makes, reads or tests pages does not, for the modules are part of the
package.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.controllers import source
from pipeline.flight.fly.many import fly_many
from pipeline.flight.state.log import Scenario
from pipeline.player.arguments import ERRING, LIT, MODULES, PLAIN, Arguments, arguments_of
from pipeline.player.memory import Memory, types_of
from pipeline.player.shares import arguments_of_shares, rule_shares
from pipeline.player.webassembly import target_machine, translate, write_module
from pipeline.settings.equipment import FilteredNavigation
from pipeline.settings.experiment import Mission
from pipeline.settings.mission import Light
from plain_files.file_access import read_shipped, write_text
from plain_files.plain_text import parse_json

FOLDER = Path(__file__).parent / "modules"
#: code for any processor, not yet optimised for this one; numba reads this when it is imported
PORTABLE = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
#: whose types all controllers of rules share
CONTROLLER = "champion_27"
#: by what each module's mission differs from the paper's
OF_MODULES: Mapping[str, Mapping[str, Any]] = {
    PLAIN: {},
    ERRING: {"navigation": FilteredNavigation()},
    LIT: {"light": Light(shadow="conical")},
}


def functions(name: str) -> list[tuple[str, Any, Arguments]]:
    """Return a module's functions: the flight, of the plain one the rules' shares, with arguments."""
    mission = replace(Mission(), **OF_MODULES[name])
    controller = source.named(CONTROLLER, mission)
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.0)
    chosen = arguments_of(mission, controller, [start])
    if chosen.module != name:
        sys.exit(f"the module {name} does not fly the world that it is built for; mend `arguments_of`")
    to_fly = chosen.arguments
    flight = ("fly", fly_many, to_fly)
    if name != PLAIN:
        return [flight]
    return [flight, ("share", rule_shares, arguments_of_shares(to_fly, controller.systems))]


def build(names: Sequence[str]) -> None:
    """Write modules, and what their types are told by."""
    path = FOLDER / "types.json"
    types = parse_json(read_shipped(path)) if path.exists() else {}
    for module in names:
        target, translated, of_module = target_machine(), [], types.setdefault(module, {})
        for name, function, arguments in functions(module):
            leaves = arguments.leaves(Memory())
            of_module[name] = types_of(leaves)
            translated.append(translate(target, name, function, arguments.kinds, leaves, of_module[name]))
        FOLDER.mkdir(exist_ok=True)
        path = FOLDER / f"{module}.wasm"
        # the first page flies a thousand times; of the other flights each is flown once
        write_module(path, target, translated, is_small=module != PLAIN)
        sys.stdout.write(f"{path.name}: {path.stat().st_size:,} bytes\n")
        sys.stdout.flush()
    write_text(FOLDER / "types.json", f"{json.dumps(types)}\n")


def main() -> None:
    """Build the modules that are named, or all, in a process of its own."""
    names = [name for name in MODULES if name in sys.argv[1:] or len(sys.argv) == 1]
    if PORTABLE.items() <= os.environ.items():
        build(names)
        return
    command = [sys.executable, "-m", "pipeline.player.build", *names]
    sys.exit(subprocess.run(command, env=os.environ | PORTABLE, check=False).returncode)  # noqa: S603


if __name__ == "__main__":
    main()
