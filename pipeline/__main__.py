"""``python -m pipeline``."""

import atexit
import gc
import sys


def main() -> int:
    """Load the program and run its command line; return the exit code."""
    atexit.register(gc.freeze)  # taking apart in the end what is loaded takes a fifth of a second
    # what is loaded stays to the end; looking through it for garbage takes a sixth of the start
    gc.disable()
    try:
        from pipeline.command_line.ahead import planning  # noqa: PLC0415 - before all that takes a while

        with planning(sys.argv[1:]) as planned:
            from pipeline.command_line import cli  # noqa: PLC0415 - takes a while

            begin = planned()
    except KeyboardInterrupt:
        sys.stderr.write("\ninterrupted before anything was done; nothing to keep\n")
        return 130
    gc.freeze()
    gc.set_threshold(100_000)  # with the usual 700 a report's pictures take a fifth longer
    gc.enable()
    return cli.main(begin=begin)


if __name__ == "__main__":
    sys.exit(main())
