"""Build the module of the player: ``python -m pipeline.player.build``.

It needs ``wasm-ld`` (``apt install lld-19``) and ``wasm-opt`` of binaryen 120 or later (``npm install
binaryen``) on the path; whoever makes, reads or tests pages does not, for the module is part of the package.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fis_tools.file_access import write_text
from pipeline.controllers import source
from pipeline.flight.fly.many import fly_many
from pipeline.flight.state.log import Scenario
from pipeline.player.arguments import Arguments, arguments_of
from pipeline.player.memory import Memory, types_of
from pipeline.player.shares import arguments_of_shares, rule_shares
from pipeline.player.webassembly import target_machine, translate, write_module
from pipeline.settings.experiment import Mission

FOLDER = Path(__file__).parent / "modules"
#: code for any processor, not yet optimised for this one; numba reads this when it is imported
PORTABLE = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
#: whose types all controllers of rules share
CONTROLLER = "champion_27"


def functions() -> list[tuple[str, Any, Arguments]]:
    """Return the module's functions: the flight and the rules' shares, with arguments of their types."""
    mission = Mission()
    controller = source.named(CONTROLLER, mission)
    start = Scenario(np.array([75.0, 0.0, 0.0]), np.zeros(3), 0.0)
    to_fly = arguments_of(mission, controller, [start])
    if to_fly is None:
        sys.exit("the module does not fly the paper's world; one of its parts was changed")
    to_share = arguments_of_shares(to_fly, controller.systems)
    return [("fly", fly_many, to_fly), ("share", rule_shares, to_share)]


def build() -> None:
    """Write the module, and what its types are told by."""
    target, translated, types = target_machine(), [], {}
    for name, function, arguments in functions():
        leaves = arguments.leaves(Memory())
        types[name] = types_of(leaves)
        translated.append(translate(target, name, function, arguments.kinds, leaves, types[name]))
    FOLDER.mkdir(exist_ok=True)
    path = FOLDER / "flight.wasm"
    write_module(path, target, translated)
    write_text(FOLDER / "types.json", f"{json.dumps(types)}\n")
    sys.stdout.write(f"{path.name}: {path.stat().st_size:,} bytes\n")


def main() -> None:
    """Build the module in a process of its own."""
    if PORTABLE.items() <= os.environ.items():
        build()
        return
    command = [sys.executable, "-m", "pipeline.player.build"]
    sys.exit(subprocess.run(command, env=os.environ | PORTABLE, check=False).returncode)  # noqa: S603


if __name__ == "__main__":
    main()
