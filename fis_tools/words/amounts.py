"""Values of variables and shares in words, rounded so that they can be read."""

from fis_tools.model import FuzzySystem, Variable
from fis_tools.typing import Floats
from fis_tools.words.text import number

#: A change below this fraction of a range is a rounding error.
NEGLIGIBLE = 1e-9


def amount(variable: Variable, value: float) -> str:
    """Format a value of a variable with four significant digits and its unit; rounding errors become 0."""
    value = 0.0 if abs(value) < NEGLIGIBLE * span(variable) else value
    return f"{number(float(f'{value:.4g}'))} {variable.unit}".rstrip()


def percent(fraction: float) -> str:
    """Format a fraction in percent, so that a small one differs from none and a large one from all."""
    for digits in (0, 1, 2):
        words = f"{100 * fraction:.{digits}f}"
        if (float(words) > 0 or fraction == 0) and (float(words) < 100 or fraction == 1):
            return f"{words} %"
    return "under 0.01 %" if fraction < 0.5 else "over 99.99 %"


def place(system: FuzzySystem, point: Floats) -> str:
    """Format an input of a system: ``distance = 80 m, velocity = 0.1 m/s``."""
    values = zip(system.inputs, point, strict=True)
    return ", ".join(f"{variable.name} = {amount(variable, value)}" for variable, value in values)


def listed(words: list[str], most: int = 3) -> str:
    """Join words with commas and "and"; of many, only the first few."""
    shown = words[:most]
    if len(words) > most:
        return f"{', '.join(shown)} and {len(words) - most} more"
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)


def span(variable: Variable) -> float:
    """Return the width of a variable's universe."""
    return variable.maximum - variable.minimum
