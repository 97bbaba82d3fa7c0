"""Systems as FMUs: blocks for Simulink, Dymola, OpenModelica and whatever else takes FMI 2.0.

An FMU is an archive: a description of inputs and outputs, the C source of `fis_tools.formats.c.source` with
the functions of the standard around it, and, where gcc is at hand, the library made of it for this machine.
"""

import io
import platform
import sys
import zipfile
from pathlib import Path
from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from fis_tools.formats.c.parts import compiled
from fis_tools.formats.c.source import function_name, write
from fis_tools.model import FuzzyController, FuzzySystem, Variable

WRAPPER = Path(__file__).with_name("fmi2.c")
#: How the standard calls the machines that a library is made for.
MACHINES = {("linux", "x86_64"): "linux64"}
#: Every entry of an archive is of this time, so that a system always gives the same bytes of source.
EPOCH = (1980, 1, 1, 0, 0, 0)


class Fmu(NamedTuple):
    """An FMU.

    Attributes
    ----------
    content : bytes
        The archive.
    library : str
        The machine that it holds a library for; empty where it holds the source alone.
    """

    content: bytes
    library: str


def pack(system: FuzzySystem, fingerprint: str) -> Fmu:
    """Return a system as an FMU for co-simulation.

    Parameters
    ----------
    system : FuzzySystem
        A system without problems; what it is part of, such as a thrust logic, is not.
    fingerprint : str
        What tells this system from every other one, in hexadecimal digits.

    Raises
    ------
    RuntimeError
        If gcc is there and refuses the source.
    ValueError
        If a rule concludes a formula.
    """
    name, guid = function_name(system), f"{{{fingerprint}}}"
    source = _defined(system, guid) + WRAPPER.read_text(encoding="utf-8")
    files = {
        "modelDescription.xml": _description(system, name, guid).encode(),
        "sources/system.c": write(FuzzyController(system.name, (system,))).encode(),
        "sources/fmi2.c": source.encode(),
    }
    machine = MACHINES.get((sys.platform, platform.machine()), "")
    library = _compiled(files) if machine else None
    if library is not None:
        files[f"binaries/{machine}/{name}.so"] = library
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as packed:
        for path, content in files.items():
            packed.writestr(zipfile.ZipInfo(path, EPOCH), content, zipfile.ZIP_DEFLATED)
    return Fmu(archive.getvalue(), machine if library is not None else "")


def _defined(system: FuzzySystem, guid: str) -> str:
    """Write what the wrapper takes from a system."""
    called = function_name(system)
    starts = ", ".join(repr(_start(variable)) for variable in system.inputs)
    inputs, outputs = len(system.inputs), len(system.outputs)
    if outputs == 1:
        declared, body = f"double {called}(const double inputs[{inputs}])", f"outputs[0] = {called}(inputs)"
    else:
        declared = f"void {called}(const double inputs[{inputs}], double outputs[{outputs}])"
        body = f"{called}(inputs, outputs)"
    return (
        f'#define GUID "{guid}"\n#define NUM_INPUTS {inputs}\n#define NUM_OUTPUTS {outputs}\n\n'
        f"static const double START[NUM_INPUTS] = {{{starts}}};\n\n{declared};\n\n"
        f"static void infer(const double inputs[], double outputs[]) {{ {body}; }}\n\n"
    )


def _description(system: FuzzySystem, name: str, guid: str) -> str:
    variables = (*system.inputs, *system.outputs)
    units = dict.fromkeys(f"<Unit name={quoteattr(v.unit)}/>" for v in variables if v.unit)
    known = " ".join(str(place) for place in range(1, len(system.inputs) + 1))
    first = len(system.inputs) + 1
    unknowns = [
        f'<Unknown index="{place}" dependencies="{known}"/>'
        for place in range(first, first + len(system.outputs))
    ]
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName={quoteattr(system.name)} guid="{guid}"'
        ' generationTool="fis_tools" variableNamingConvention="flat" numberOfEventIndicators="0">',
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"'
        ' canNotUseMemoryManagementFunctions="true"><SourceFiles><File name="system.c"/>'
        '<File name="fmi2.c"/></SourceFiles></CoSimulation>',
        *(["<UnitDefinitions>", *units, "</UnitDefinitions>"] if units else []),
        "<ModelVariables>",
        *(_variable(place, v, place < len(system.inputs)) for place, v in enumerate(variables)),
        "</ModelVariables>",
        "<ModelStructure>",
        *("<Outputs>", *unknowns, "</Outputs>"),
        *("<InitialUnknowns>", *unknowns, "</InitialUnknowns>"),
        "</ModelStructure>",
        "</fmiModelDescription>",
    ]
    return "\n".join(parts) + "\n"


def _variable(place: int, variable: Variable, is_input: bool) -> str:
    about = f"{variable.description or variable.name}, {variable.minimum:g} to {variable.maximum:g}"
    unit = f" unit={quoteattr(variable.unit)}" if variable.unit else ""
    role, start = 'causality="output" initial="calculated"', ""
    if is_input:
        role, start = 'causality="input"', f' start="{_start(variable)!r}"'
    return (
        f'<ScalarVariable name={quoteattr(variable.name)} valueReference="{place}" {role}'
        f' variability="continuous" description={quoteattr(about)}><Real{unit}{start}/></ScalarVariable>'
    )


def _start(variable: Variable) -> float:
    return float(0.5 * (variable.minimum + variable.maximum))


def _compiled(files: dict[str, bytes]) -> bytes | None:
    """Return the library that gcc makes of the sources; None without gcc."""
    sources = {Path(path).name: content for path, content in files.items() if path.startswith("sources/")}
    options = ["-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared"]
    options += [*sources, "-o", "library.so", "-lm"]
    return compiled(sources, options, "library.so", "source")
