"""What vectors need of numba and llvmlite beyond numba's documented interface for extensions.

No other module of the product imports numba's inner parts, so a new release of numba is tried by running
the tests of this folder. Tried with numba 0.68 and llvmlite 0.50.

- `ir` writes LLVM code, and `cgutils` has numba's helpers for it: the bodies of vector operations.
- `AbstractTemplate`, `AttributeTemplate` and `infer_global` tell numba the type of an operation or attribute.
- `GetItemBuffer` and `SetItemBuffer` are numba's own types of array elements.
- `event` announces compilations; it is documented, but not part of ``numba.extending``.
- `binding` is llvmlite's public interface; it knows the processor.
"""

import llvmlite
import numba

try:
    from llvmlite import binding, ir
    from numba.core import cgutils, event
    from numba.core.typing.arraydecl import GetItemBuffer, SetItemBuffer
    from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global
except ImportError as error:
    raise ImportError(
        f"numba {numba.__version__} lacks what compiled vectors are made with ({error}); "
        "they are tested with numba 0.68; install it: pip install 'numba>=0.62,<0.69'"
    ) from error

#: The releases that compile.
VERSIONS = (numba.__version__, llvmlite.__version__)
