"""Systems as FMUs: blocks for Simulink, Dymola, OpenModelica and whatever else takes FMI 2.0.

An FMU is an archive: a description of inputs and outputs, the C source of `fis_tools.formats.c.source` with
the functions of the standard around it, and, where gcc is at hand, the library made of it for this machine.
"""

import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from fis_tools.formats import rendered
from fis_tools.formats.c.source import function_name, write
from fis_tools.model import FuzzyController
from fis_tools.model.thrust import thrust_logic
from plain_files.file_access import read_bytes, write_bytes

#: How the standard calls the machines that a library is made for.
MACHINES = {("linux", "x86_64"): "linux64"}
#: Every entry of an archive is of this time, so that a system always gives the same bytes of source.
EPOCH = (1980, 1, 1, 0, 0, 0)


def pack(controller: FuzzyController, fingerprint: str) -> tuple[bytes, list[str]]:
    """Return the one system of a controller as an FMU for co-simulation, and what that does not hold.

    Parameters
    ----------
    controller : FuzzyController
        A controller without problems.
    fingerprint : str
        Hexadecimal digits that identify this system.

    Raises
    ------
    RuntimeError
        If gcc is there and refuses the source.
    ValueError
        If a rule concludes a formula.
    """
    (system,) = controller.systems
    facts = {
        "system": system,
        "name": function_name(system),
        "guid": f"{{{fingerprint}}}",
        "starts": [float(0.5 * (variable.minimum + variable.maximum)) for variable in system.inputs],
    }
    files = {
        "modelDescription.xml": rendered("c/modelDescription.xml.jinja", **facts).encode(),
        "sources/system.c": write(FuzzyController(system.name, (system,))).encode(),
        "sources/fmi2.c": rendered("c/fmi2.c.jinja", **facts).encode(),
    }
    machine = MACHINES.get((sys.platform, platform.machine()), "")
    library = _compiled(files) if machine else None
    if library is not None:
        files[f"binaries/{machine}/{facts['name']}.so"] = library
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as packed:
        for path, content in files.items():
            packed.writestr(zipfile.ZipInfo(path, EPOCH), content, zipfile.ZIP_DEFLATED)
    losses = []
    if library is None:
        losses.append("it holds the source alone: a library is made where gcc is, on Linux and x86-64")
    logic = thrust_logic(controller)
    if logic is not None:
        ahead = " and the pushes that it plans ahead" if logic.plans_ahead else ""
        ahead += " and the push that parks" if logic.parks else ""
        losses.append(f"it holds inference alone, without the thrust logic of the controller{ahead}")
    return archive.getvalue(), losses


def _compiled(files: dict[str, bytes]) -> bytes | None:
    """Return the library that gcc makes of the sources; None without gcc."""
    gcc = shutil.which("gcc")
    if gcc is None:
        return None
    options = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared"]
    with tempfile.TemporaryDirectory() as folder:
        sources = [Path(folder) / Path(path).name for path in files if path.startswith("sources/")]
        for path in sources:
            write_bytes(path, files[f"sources/{path.name}"])
        words = [gcc, *options, *(path.name for path in sources), "-o", "library.so", "-lm"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode != 0:
            raise RuntimeError(f"gcc refuses the source: {done.stderr.strip()}")
        return read_bytes(Path(folder) / "library.so")  # file: the library that gcc just made
