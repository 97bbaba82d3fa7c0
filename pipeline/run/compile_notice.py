"""Says in words that the first flight waits for the compiler."""

import sys

from fis_tools.engines import cache


def announce_compilation() -> None:
    """Tell, once a state of the sources, that kernels are being compiled."""
    if cache.is_cold():
        cache.drop_old_caches()
        sys.stderr.write("  compiling the flight kernel, about 30 s; the next start finds it done\n")
        sys.stderr.flush()
