"""Compilation of functions that only compiled code calls: up to the stage at which callers link them.

numba optimises every function completely and turns it into machine code, then does so again within all its
callers. A function without an entry for Python never runs by itself, so here it stays as numba first
generates it; its callers optimise it with their own code. Results stay bit-identical: every
operation is rounded separately.
"""

from typing import Any

from numba import version_info
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import AnnotateTypes

#: The releases of numba whose code libraries are known to work as `_Unfinished` expects.
KNOWN = {(0, 68)}


class _Nowhere:
    """Stands in for the environment that machine code is given, where there is none."""

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


class _Unfinished(JITCodeLibrary):
    """A library of code that is only linked into others."""

    def _optimize_final_module(self) -> None:
        """Leave that to the callers that link it."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return no pointer, as numba does for a function without an entry for Python."""
        return 0

    @property
    def codegen(self) -> Any:
        return _Nowhere()


@register_pass(mutates_CFG=False, analysis_only=True)
class _LeaveUnfinished(LoweringPass):
    _name = "leave_unfinished"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Give the function its library before numba makes one."""
        state.library = _Unfinished(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class _Callee(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.add_pass_after(_LeaveUnfinished, AnnotateTypes)
        manager.finalize()
        return [manager]


#: numba's options for such a function
OPTIONS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
if version_info.short in KNOWN:
    OPTIONS["pipeline_class"] = _Callee
