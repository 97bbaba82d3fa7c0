"""Make the documentation: ``python -m docs COMMAND``.

``build`` makes the site, ``home`` the page on which you fly. ``tables`` flies the tables of results again,
``shown`` runs the commands whose output stands on pages, ``pictures`` and ``drawings`` make what they name.
"""

import runpy
import sys

COMMANDS = ("build", "home", "tables", "shown", "pictures", "drawings")


def main() -> None:
    """Run a command with the words that follow it."""
    command, *words = sys.argv[1:] or ["--help"]
    if command in ("-h", "--help"):
        print(__doc__)
    elif command not in COMMANDS:
        sys.exit(f"python -m docs {command}: there is no such command; choose one of {', '.join(COMMANDS)}")
    else:
        sys.argv = [f"python -m docs {command}", *words]
        runpy.run_module(f"docs.scripts.{command}", run_name="__main__")


if __name__ == "__main__":
    main()
