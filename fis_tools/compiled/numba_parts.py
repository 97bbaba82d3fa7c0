"""What vectors need of numba and llvmlite beyond numba's documented interface for extensions.

No other module of the product imports numba's inner parts, so a new release of numba is tried by running
the tests of this folder. Tried with numba 0.68 and llvmlite 0.50.

- `ir` writes LLVM code, and `cgutils` has numba's helpers for it: the bodies of vector operations.
- `AbstractTemplate`, `AttributeTemplate` and `infer_global` tell numba the type of an operation or attribute.
- `GetItemBuffer` and `SetItemBuffer` are numba's own types of array elements.
- `event` announces compilations; it is documented, but not part of ``numba.extending``.
- `CPUDispatcher` compiles a function for the types it is called with; `Cache` is the class of what keeps its
  code, which is a `CompileResult`, and `dumps` pickles one.
- `binding` is llvmlite's public interface; it knows the processor.
"""

from typing import Any

import llvmlite
import numba

try:
    from llvmlite import binding, ir
    from numba import config
    from numba.core import cgutils, event
    from numba.core.caching import _Cache as Cache
    from numba.core.compiler import CompileResult
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import CPUDispatcher, cpu_target
    from numba.core.serialize import dumps
    from numba.core.typing.arraydecl import GetItemBuffer, SetItemBuffer
    from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global
except ImportError as error:
    raise ImportError(
        f"numba {numba.__version__} lacks what compiled vectors are made with ({error}); "
        "they are tested with numba 0.68; install it: pip install 'numba>=0.62,<0.69'"
    ) from error

#: The releases that compile.
VERSIONS = (numba.__version__, llvmlite.__version__)

#: Settings of numba that change the code it makes.
SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT", "DISABLE_INTEL_SVML"),
    *("ENABLE_AVX", "LLVM_REFPRUNE_PASS", "LLVM_REFPRUNE_FLAGS"),
)


def surroundings() -> tuple[Any, ...]:
    """Return the releases, the processor and the settings that all compiled code depends on."""
    settings = tuple(str(getattr(config, name, None)) for name in SETTINGS)
    return *VERSIONS, *cpu_target.target_context.codegen().magic_tuple(), settings
