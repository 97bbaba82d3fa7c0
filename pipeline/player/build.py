"""Build the modules of the player: ``python -m pipeline.player.build [plain] [lit]``.

It needs ``wasm-ld`` (``apt install lld-19``) and ``wasm-opt`` of binaryen 120 or later (``npm install
binaryen``) on the path; whoever makes, reads or tests pages does not, for the modules are part of the
package.
"""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.controllers import source
from pipeline.flight.fly.many import fly_many
from pipeline.flight.state.log import Scenario
from pipeline.player.arguments import LIT, PLAIN, Arguments, arguments_of
from pipeline.player.memory import Memory, types_of
from pipeline.player.shares import arguments_of_shares, rule_shares
from pipeline.player.webassembly import target_machine, translate, write_module
from pipeline.settings.experiment import Mission

FOLDER = Path(__file__).parent / "modules"
#: code for any processor, not yet optimised for this one; numba reads this when it is imported
PORTABLE = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
#: whose types all controllers of rules share
CONTROLLER = "champion_27"


def build(name: str) -> None:
    """Write a module: the flight, and of the plain one the rules' shares as well."""
    mission = Mission()
    controller = source.named(CONTROLLER, mission)
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.0)
    chosen = arguments_of(mission, controller, [start], module=name)
    if chosen is None:
        sys.exit("no module flies the paper's world; one of its parts was changed")
    _, to_fly = chosen
    functions: list[tuple[str, Any, Arguments]] = [("fly", fly_many, to_fly)]
    if name == PLAIN:
        functions.append(("share", rule_shares, arguments_of_shares(to_fly, controller.systems)))
    target, translated = target_machine(), []
    for function_name, function, arguments in functions:
        leaves = arguments.leaves(Memory())
        types = types_of(leaves)
        translated.append(translate(target, function_name, function, arguments.kinds, leaves, types))
    FOLDER.mkdir(exist_ok=True)
    write_module(FOLDER / f"{name}.wasm", target, translated)
    sys.stdout.write(f"{name}.wasm: {(FOLDER / f'{name}.wasm').stat().st_size:,} bytes\n")


def main() -> None:
    """Build the modules that are named, or both, in a process of its own."""
    names = [name for name in (PLAIN, LIT) if name in sys.argv[1:] or len(sys.argv) == 1]
    if PORTABLE.items() <= os.environ.items():
        for name in names:
            build(name)
        return
    command = [sys.executable, "-m", "pipeline.player.build", *names]
    sys.exit(subprocess.run(command, env=os.environ | PORTABLE, check=False).returncode)  # noqa: S603


if __name__ == "__main__":
    main()
