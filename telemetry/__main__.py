"""Entry point of ``python -m telemetry``."""

import sys

from telemetry.commands import main

if __name__ == "__main__":
    sys.exit(main())
