"""Which variable is meant where a name may be left out."""

from typing import Literal

from fis_tools.model import FuzzySystem, Variable
from fis_tools.model.validate import nearest


def named(system: FuzzySystem, role: Literal["input", "output"], name: str | None) -> Variable:
    """Return the input or the output of a name, without one the first.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    variables = system.inputs if role == "input" else system.outputs
    names = [variable.name for variable in variables]
    if name is not None and name not in names:
        raise ValueError(f"system {system.name!r} has no {role} {name!r}; {nearest(name, names)}")
    return variables[0 if name is None else names.index(name)]
