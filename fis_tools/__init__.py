"""Fuzzy inference systems as readable data, with a compiled evaluator and the means to review them.

>>> import fis_tools
>>> controller = fis_tools.read_controller("tipper.fis")  # doctest: +SKIP
>>> tip = fis_tools.compile(controller.systems[0])  # doctest: +SKIP
>>> tip({"service": [3.0, 9.0], "food": 7.0})  # doctest: +SKIP
{'tip': array([12.21531604, 24.43823122])}

`compile` takes scikit-fuzzy's ``ControlSystem`` as well. The rest is found by its noun: `findings.audit`,
`findings.explanation`, `analysis.bounds`, `findings.difference`, `findings.simplification`, `render`,
`review`. In a notebook controllers, systems and variables show themselves.
"""

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fis_tools.engines import cache

if TYPE_CHECKING:
    from fis_tools.engines.compiler import CompiledSystem, compile
    from fis_tools.source import read_controller

__all__ = ["CompiledSystem", "compile", "read_controller"]

#: where the names are that are found here; fetched when they are asked for, since both take a while to import
_PLACES = {
    "CompiledSystem": "engines.compiler",
    "compile": "engines.compiler",
    "read_controller": "source",
}

cache.use_cache_keyed_by(Path(__file__).parent)


def __getattr__(name: str) -> Any:
    """Fetch a name of `__all__` from the module that defines it."""
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def _show_in_notebook() -> None:
    shell = sys.modules["IPython"].get_ipython()
    if shell is not None:
        import_module(f"{__name__}.render.notebook").show_in(shell)


if "IPython" in sys.modules:
    _show_in_notebook()
