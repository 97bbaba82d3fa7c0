"""One line for each thing that people do with a fuzzy system, whatever form they have it in.

Each takes a scikit-fuzzy control system, a system, a controller, or the path of a file of any format.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fis_tools.model import FuzzySystem
from fis_tools.source import as_controller


def _only_system(thing: object) -> FuzzySystem:
    """Return the one system of something.

    Raises
    ------
    ValueError
        If it has several.
    """
    controller = as_controller(thing)
    if len(controller.systems) != 1:
        names = ", ".join(system.name for system in controller.systems)
        raise ValueError(f"controller {controller.name!r} has several systems; pass one of {names}")
    return controller.systems[0]


def audit(thing: object) -> Any:
    """List what a reviewer should know; see `fis_tools.findings.audit.audit`."""
    from fis_tools.findings import audit as findings  # noqa: PLC0415 - each line imports what it needs

    return findings.audit(as_controller(thing))


def explain(thing: object, inputs: Mapping[str, float]) -> Any:
    """Tell which rules moved the outputs; see `fis_tools.findings.explanation.explain`."""
    from fis_tools.findings import explanation  # noqa: PLC0415

    return explanation.explain(_only_system(thing), inputs)


def surface(thing: object, x: str | None = None, y: str | None = None, **options: Any) -> Any:
    """Evaluate an output over two inputs; see `fis_tools.analysis.arrays.surface`."""
    from fis_tools.analysis import arrays  # noqa: PLC0415

    return arrays.surface(_only_system(thing), x, y, **options)


def plot(thing: object, folder: Path | str = "figures", form: str = "png") -> list[Path]:
    """Draw terms, rules and surfaces of every system into a folder; return the files."""
    from fis_tools import render  # noqa: PLC0415

    Path(folder).mkdir(parents=True, exist_ok=True)
    found = []
    for system in as_controller(thing).systems:
        for name, figure in render.system_figures(system):
            found.append(Path(folder) / f"{system.name}-{name}.{form}".replace("/", "_"))
            render.save(figure, found[-1])
    return found


def export_c(thing: object, path: Path | str) -> Path:
    """Write one C99 file that infers as Python does; see `fis_tools.formats.c.source.write`."""
    from fis_tools.formats.c import source  # noqa: PLC0415

    Path(path).write_text(source.write(as_controller(thing)), encoding="utf-8")
    return Path(path)
