"""The maker of a run's files: this product, its libraries, and the processor they are compiled for.

Two equal makers produce the same files from the same configuration, bit for bit. Our compiled code
rounds each operation separately (IEEE 754), and so gives the same bits on all processors.

Libraries choose among variants by the processor's features, and these differ in their last digits. With the
setting ``reproducible`` they use the same mathematics on all x86-64 processors. They choose when loaded, so
that a process must be started with the right environment.
"""

import hashlib
import os
import platform
import signal
import subprocess
import sys
import threading
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final, NoReturn

from pipeline.settings import plugged
from plain_files.file_access import read_shipped

DISTRIBUTION: Final = "fuzzy-spacecraft-inspection"
SOURCES: Final = Path(__file__).resolve().parents[2]
#: packages whose version may change a result or a file
LIBRARIES: Final = (
    "numpy",
    "scipy",
    "numba",
    "scikit-fuzzy",
    "scikit-learn",
    "deap",
    "hydra-core",
    "mcap",
    "protobuf",
    "pyarrow",
    "matplotlib",
    "rerun-sdk",
)
#: packages whose sources affect results
PACKAGES: Final = ("pipeline", "fis_tools", "telemetry", "plain_files")
#: properties of a processor that affect last digits; the rest is for the record
ROUNDING: Final = ("machine", "libm", "numpy", "blas")


def present_maker() -> dict[str, Any]:
    """Describe what makes files now: the program, its sources, and the processor, as plain data.

    Returns
    -------
    dict
        ``versions``, ``git_revision`` (or None), ``sources``, a hash of all of them, and ``processor``.
    """
    return {**product(), "processor": processor()}


@cache
def product() -> Mapping[str, Any]:
    """Return the part of a maker that is the same on every processor."""
    return {"versions": versions(), "git_revision": git_revision(), "sources": sources_hash()}


def unlike(maker: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return the differences between two makers in words."""

    def changed(part: str, names: Iterable[str]) -> list[str]:
        first, second = maker.get(part, {}), other.get(part, {})
        differing = (name for name in names if name in first and first[name] != second.get(name))
        return [f"{name} {first[name]}, now {second.get(name)}" for name in differing]

    differences = changed("versions", maker.get("versions", {}))
    if maker.get("sources") != other.get("sources"):
        differences.append("other sources" if maker.get("sources") else "unknown sources")
    return differences + changed("processor", ROUNDING)


def unfit(asker: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Return in words why results of another process may not stand beside those of one that asks for them.

    Program and libraries must be the same. If the asker is reproducible, the other must be so too, and round
    alike; else processors may differ, which the manifest names.
    """
    is_reproducible = asker["processor"]["reproducible"]
    if is_reproducible and not other["processor"]["reproducible"]:
        return [f"not started for reproducible=true, with {start_variables()}"]
    # the kernel of the operating system rounds nothing
    versions = {name: number for name, number in asker["versions"].items() if name != "platform"}
    rounding = asker["processor"] if is_reproducible else {}
    return unlike({**asker, "versions": versions, "processor": rounding}, other)


#: makers of the tasks that others have carried out since `collected` began; None outside it
_others: ContextVar[list[Mapping[str, Any]] | None] = ContextVar("_others", default=None)


@contextmanager
def collected() -> Iterator[list[Mapping[str, Any]]]:
    """Yield a list that gets each maker with which `collect` is called inside, once."""
    made: list[Mapping[str, Any]] = []
    token = _others.set(made)
    try:
        yield made
    finally:
        _others.reset(token)


def collect(maker: Mapping[str, Any]) -> None:
    """Record that a maker, of this process or another, has made a part of the present stage."""
    others = _others.get()
    if others is not None and maker not in others:
        others.append(maker)


def sources_hash() -> str:
    """Return the SHA-256 of the names and contents of all sources, 64 hexadecimal digits."""
    digest = hashlib.sha256()
    for package in PACKAGES:
        for path in sorted((SOURCES / package).rglob("*.py")):
            digest.update(f"{path.relative_to(SOURCES).as_posix()} ".encode())
            digest.update(hashlib.sha256(read_shipped(path).encode()).digest())
    return digest.hexdigest()


@cache
def processor() -> dict[str, Any]:
    """Describe the processor, its compilation target, and the variants that libraries chose."""
    import numpy as np  # noqa: F401, PLC0415 - brings the linear algebra that is asked about
    from llvmlite import binding  # noqa: PLC0415 - only runs need them
    from threadpoolctl import threadpool_info  # noqa: PLC0415 - as above

    host_features = binding.get_host_cpu_features()
    features = os.environ.get("NUMBA_CPU_FEATURES", host_features.flatten())
    has_fma = host_features.get("fma", False) and host_features.get("avx2", False) and not is_libm_fixed()
    pools = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
    blas = {f"{pool.get('architecture')} x{pool['num_threads']}" for pool in pools}
    return {
        "machine": platform.machine(),
        "compiled_for": os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name(),
        "features": ",".join(sorted(word for word in features.split(",") if word.startswith("+"))),
        "libm": " ".join((*platform.libc_ver(), "with fma" if has_fma else "without fma")).strip(),
        "numpy": " ".join(numpy_variants()) or "baseline",
        "blas": ", ".join(sorted(blas)) or "unknown",
        "reproducible": is_in_force(),
    }


def product_version() -> str:
    """Return the version of this product, from the source tree or else the installed package.

    It is ``unknown`` if the packages were copied without being installed.
    """
    project = SOURCES / "pyproject.toml"
    if project.is_file():
        table = tomllib.loads(read_shipped(project)).get("project", {})
        if table.get("name") == DISTRIBUTION:
            return str(table["version"])
    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


def versions() -> dict[str, str]:
    """Return the versions of this product, Python, libraries, packages of one's own, and the platform."""
    numbers = {"product": product_version(), "python": platform.python_version()}
    numbers["platform"] = platform.platform()
    for library in LIBRARIES:
        try:
            numbers[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            numbers[library] = "absent"
    return numbers | plugged.versions()


def git_revision() -> str | None:
    """Return the revision of the sources, with ``+changes`` if files differ from it; None without git."""
    if not (SOURCES / ".git").exists():
        return None
    command = ["git", "-C", str(SOURCES), "status", "--porcelain=v2", "--branch", "--untracked-files=no"]
    try:
        done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=20)  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return None
    lines = done.stdout.splitlines()
    revision = lines[0].removeprefix("# branch.oid ")
    if revision == "(initial)":
        return None
    return revision + "+changes" * any(not line.startswith("#") for line in lines)


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
    """Return the environment variables of a reproducible process."""
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


def require_reproducible() -> None:
    """Raise NotInForce unless this process was started with the `environment`.

    Raises
    ------
    NotInForce
    """
    if not is_in_force():
        raise NotInForce(
            f"reproducible is true, and Python was not started for it; start it with {start_variables()}"
        )


def start_variables() -> str:
    """Return the `environment` as it is written before a command."""
    return " ".join(f"{name}='{value}'" for name, value in environment().items())


def run_anew(words: Sequence[str]) -> int:
    """Run Python with the `environment` in a child process; see `run_child`."""
    return run_child(words, environment(), sys.stdout, sys.stderr)


def run_child(words: Sequence[str], variables: Mapping[str, str], output: Any, errors: Any) -> int:
    """Run Python in a child process; return its exit code, below zero after a signal.

    An interrupt is passed on to it.

    Parameters
    ----------
    words : sequence of str
        The command line after Python's own name.
    variables : mapping of str to str
        Added to its environment.
    output, errors : text streams
        Receive the lines that it prints.
    """
    path = os.pathsep.join(filter(None, (str(SOURCES), os.environ.get("PYTHONPATH"))))
    child = subprocess.Popen(  # noqa: S603
        [sys.executable, *words],
        env={**os.environ, **variables, "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
        errors="replace",
        process_group=0 if os.name == "posix" else None,  # so that an interrupt comes to it once
    )
    with child:
        copies = [
            threading.Thread(target=_copy, args=(pipe, stream), daemon=True)
            for pipe, stream in ((child.stdout, output), (child.stderr, errors))
        ]
        for copy in copies:
            copy.start()
        while True:
            try:
                code = child.wait()
                for copy in copies:
                    copy.join()
                return code
            except KeyboardInterrupt:
                child.send_signal(signal.SIGINT)
            except BaseException:
                child.kill()
                raise


def _copy(pipe: Any, stream: Any) -> None:
    """Copy text line by line until its end; drop lines that cannot be written."""
    for line in pipe:
        with suppress(OSError, ValueError):
            stream.write(line)
            stream.flush()


def start_anew(words: Sequence[str]) -> NoReturn:
    """Replace this process, which is the program's, by one with the `environment`.

    Parameters
    ----------
    words : sequence of str
        The command line after Python's own name.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(sys.executable, [sys.executable, *words], {**os.environ, **environment()})  # noqa: S606
