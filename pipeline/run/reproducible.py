"""The setting ``reproducible``: libraries choose the same mathematics on all x86-64 processors.

What we compile rounds each operation by itself (IEEE 754), and so gives the same bits on all of them. The
libraries below choose among variants by the processor's features, and these differ in their last digits. They
choose when they are loaded, so that a process has to be started with what is asked of them.
"""

import os
import sys
from collections.abc import Sequence
from typing import Final, NoReturn

#: OpenBLAS's kernels for the oldest processor that NumPy runs on, and an order of sums that no number of
#: threads changes; numba without Intel's vector mathematics, which it calls where that is installed
FIXED: Final = {"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "1", "NUMBA_DISABLE_INTEL_SVML": "1"}
#: glibc's sine and its like without fused multiply-add
LIBM: Final = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"
TUNABLES: Final = "GLIBC_TUNABLES"
DISABLED: Final = "NPY_DISABLE_CPU_FEATURES"


class NotInForce(RuntimeError):  # noqa: N818 - the command line answers it by starting anew
    """A process whose libraries chose for themselves, asked for reproducible results."""


def numpy_variants() -> list[str]:
    """Return the features of the processor that NumPy makes use of beyond those that it requires."""
    import numpy as np  # noqa: PLC0415 - takes long to import, and most commands do without

    return list(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", []))


def environment() -> dict[str, str]:
    """Return the variables with which a process has to be started; in one that was, those that it has."""
    tunables = [word for word in os.environ.get(TUNABLES, "").split(":") if word and word != LIBM]
    disabled = os.environ.get(DISABLED, "").split()
    disabled += [name for name in numpy_variants() if name not in disabled]
    return {**FIXED, TUNABLES: ":".join((*tunables, LIBM)), DISABLED: " ".join(disabled)}


def is_libm_fixed() -> bool:
    """Tell whether this process was started with the libm that `environment` asks for."""
    return LIBM in os.environ.get(TUNABLES, "").split(":")


def is_in_force() -> bool:
    """Tell whether this process was started with the `environment`."""
    return all(os.environ.get(name, "") == value for name, value in environment().items())


def require() -> None:
    """Refuse to make reproducible results in a process that was not started with the `environment`.

    Raises
    ------
    NotInForce
    """
    if not is_in_force():
        told = " ".join(f"{name}='{value}'" for name, value in environment().items())
        raise NotInForce(f"reproducible is true, and Python was not started for it; start it with {told}")


def start_anew(words: Sequence[str]) -> NoReturn:
    """Replace this process by one with the `environment`.

    Parameters
    ----------
    words : sequence of str
        The command line after Python's own name.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(sys.executable, [sys.executable, *words], {**os.environ, **environment()})  # noqa: S606
