"""What numba makes and keeps of a function's code, without what is never used.

A function that only compiled code calls is left at the stage at which callers link it. numba optimises every
function completely and turns it into machine code, then does so again within all its callers. A function
without an entry for Python never runs by itself, so here it stays as numba first generates it; its
callers optimise it with their own code. Results stay bit-identical: every operation is rounded separately.

A function that is called from Python is never linked into another (see `fis_tools.compiled.decorator`): only
its machine code is kept in the cache, not the code for LLVM, which takes longer to load than to run.
"""

from typing import Any

from llvmlite import binding, ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import AnnotateTypes

from fis_tools.compiled.loading import IS_KNOWN


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


class _Unlinked(JITCodeLibrary):
    """A library of code that is linked into no other."""

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Return the machine code for the cache, and of the code for LLVM only the names it defines."""
        self._ensure_finalized()
        return self.name, "object", (self._get_compiled_object(), _names_in(self._get_module_for_linking()))


def _names_in(module: binding.ModuleRef) -> bytes:
    """Return the code for LLVM of a module that defines the same names, with nothing in them."""
    names, nothing = ir.Module(), ir.FunctionType(ir.VoidType(), ())
    for known in module.functions:
        if not known.is_declaration:
            ir.IRBuilder(ir.Function(names, nothing, known.name).append_basic_block()).ret_void()
    for known in module.global_variables:
        if not known.is_declaration:
            ir.GlobalVariable(names, ir.IntType(8), known.name).initializer = ir.Constant(ir.IntType(8), 0)
    return bytes(binding.parse_assembly(str(names)).as_bitcode())


def _options(library: type[JITCodeLibrary]) -> dict[str, Any]:
    """Return the option of numba that gives functions such a library; none for a release not known."""
    if not IS_KNOWN:
        return {}

    @register_pass(mutates_CFG=False, analysis_only=True)
    class MakeLibrary(LoweringPass):
        _name = f"make_{library.__name__}"

        def __init__(self) -> None:
            LoweringPass.__init__(self)

        def run_pass(self, state: Any) -> bool:
            """Give the function its library before numba makes one."""
            state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return False

    class Compiler(CompilerBase):
        def define_pipelines(self) -> list[Any]:
            manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
            manager.add_pass_after(MakeLibrary, AnnotateTypes)
            manager.finalize()
            return [manager]

    return {"pipeline_class": Compiler}


#: numba's options for a function that is called from Python, and for one that only compiled code calls
ENTRY: dict[str, Any] = _options(_Unlinked)
CALLEE: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **_options(_Unfinished)}
