"""``python -m pipeline``."""

import atexit
import gc
import sys

from pipeline.run import interrupts


def main() -> int:
    """Load the program and run its command line; return the exit code."""
    interrupts.remember()
    atexit.register(gc.freeze)  # taking apart in the end what is loaded takes a fifth of a second
    try:
        with interrupts.heeded():
            from pipeline.command_line import cli  # noqa: PLC0415 - takes a while, and may be interrupted
        return cli.main()
    except KeyboardInterrupt:
        sys.stderr.write("\ninterrupted before anything was done; nothing to keep\n")
        return 130


if __name__ == "__main__":
    sys.exit(main())
