"""The setting ``reproducible``: libraries use the same mathematics on all x86-64 processors.

Our compiled code rounds each operation separately (IEEE 754), and so gives the same bits on all of them. The
libraries below choose among variants by the processor's features, and these differ in their last digits. They
choose when loaded, so that a process must be started with the right environment.
"""

import os
import sys
from collections.abc import Sequence
from typing import Final, NoReturn

#: OpenBLAS's kernels for the oldest processor that NumPy supports, with an order of sums independent of the
#: number of threads; numba without Intel's vector mathematics, which it calls if installed
FIXED: Final = {"OPENBLAS_CORETYPE": "Nehalem", "OPENBLAS_NUM_THREADS": "1", "NUMBA_DISABLE_INTEL_SVML": "1"}
#: glibc's elementary functions without fused multiply-add
LIBM: Final = "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4"
TUNABLES: Final = "GLIBC_TUNABLES"
DISABLED: Final = "NPY_DISABLE_CPU_FEATURES"


class NotInForce(RuntimeError):  # noqa: N818 - the command line handles it by restarting
    """Reproducible results were requested of a process whose libraries chose their own variants."""


def numpy_variants() -> list[str]:
    """Return the processor features that NumPy uses beyond those that it requires."""
    import numpy as np  # noqa: PLC0415 - slow to import, and most commands do without

    return list(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", []))


def environment() -> dict[str, str]:
    """Return the environment variables for a reproducible process; in such a process, those that it has."""
    tunables = [word for word in os.environ.get(TUNABLES, "").split(":") if word and word != LIBM]
    disabled = os.environ.get(DISABLED, "").split()
    disabled += [name for name in numpy_variants() if name not in disabled]
    return {**FIXED, TUNABLES: ":".join((*tunables, LIBM)), DISABLED: " ".join(disabled)}


def is_libm_fixed() -> bool:
    """Return whether this process was started with the libm setting of `environment`."""
    return LIBM in os.environ.get(TUNABLES, "").split(":")


def is_in_force() -> bool:
    """Return whether this process was started with the `environment`."""
    return all(os.environ.get(name, "") == value for name, value in environment().items())


def require() -> None:
    """Raise NotInForce unless this process was started with the `environment`.

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
