"""The command line: show, draw, question and exchange fuzzy controllers."""

import io
import sys
from collections.abc import Sequence
from typing import NoReturn

from cyclopts import App, CycloptsError, Parameter

from fis_tools.commands import COMMANDS
from fis_tools.errors import MissingExtra, Mistake
from plain_files.streams import guarded, run_program

HELP = """\
Review a fuzzy controller: look at it, draw it, and ask why it does what it does.

For example:

    python -m fis_tools show outputs/train/TIME
    python -m fis_tools plot controller.yaml -o figures
    python -m fis_tools audit controller.yaml --flights episodes/*.mcap --fail-on serious
    python -m fis_tools explain controller.yaml --inputs distance=80,velocity_body_x=0.05
    python -m fis_tools explain episodes/best.mcap --time 600
    python -m fis_tools explain controller.yaml --flights episodes/*.mcap
    python -m fis_tools bounds controller.yaml --where "distance > 150" --ask "force_x > 0"
    python -m fis_tools diff before.yaml after.yaml -o diff.html
    python -m fis_tools simplify controller.yaml --max-change 5% -o simpler.yaml
    python -m fis_tools export controller.yaml --format markdown > controller.md
    python -m fis_tools import tipper.fis -o tipper.yaml
    python -m fis_tools learn table.csv --target y -o learned.json
    python -m fis_tools review controller.yaml --flights episodes/*.mcap -o review.html

`python -m fis_tools COMMAND --help` tells more about each command.
"""

#: commands that there were, and what does their work
GONE = {"firing": "`explain CONTROLLER --flights FLIGHT...`"}
MISTAKE = 2
#: as shells do for SIGINT
INTERRUPTED = 130


def command_line(command: str | None) -> App:
    """Return the command line; only the requested command is imported."""
    app = App(
        name="python -m fis_tools",
        help=HELP,
        help_format="markdown",
        version_flags=(),
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(negative=(), show_default=_shown),
    )
    for index, (name, (module, summary)) in enumerate(COMMANDS.items()):
        # a keyword of Python cannot name a function
        function = "import_" if name == "import" else name
        description = None if name == command else summary
        app.command(f"fis_tools.commands.{module}:{function}", name=name, help=description, sort_key=index)
    return app


def _shown(default: object) -> str | None:
    """Return a default as help shows it; None for one left out."""
    return None if default in (None, False, (), "") else str(default)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns 0, 1 where a check fails, 2 for a mistake told in a sentence, 130 after Ctrl-C.
    """
    with guarded():
        return _main(list(sys.argv[1:] if words is None else words))


def _main(words: Sequence[str]) -> int:
    """Run a command line; return its exit code, having printed why it failed if it did."""
    chosen = next((word for word in words if not word.startswith("-")), None)
    try:
        status = command_line(chosen)(
            words or ["--help"], exit_on_error=False, print_error=False, result_action="return_value"
        )
        sys.stdout.flush()
    except CycloptsError as mistake:
        command = (
            f"python -m fis_tools {chosen} --help" if chosen in COMMANDS else "python -m fis_tools --help"
        )
        why = f"{chosen} is now part of {GONE[chosen]}." if chosen in GONE else mistake
        message = f"{why} `{command}` tells more."
    except OSError as mistake:
        output = mistake.filename or "the output"
        message = f"{output} cannot be written ({mistake.strerror}); choose another place"
    except (Mistake, MissingExtra) as mistake:
        message = str(mistake)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    else:
        return int(status or 0) if words else MISTAKE
    print(f"error: {message}", file=sys.stderr)
    return MISTAKE


def program() -> NoReturn:
    """Run the command line of this process, and end it."""
    if isinstance(sys.stdout, io.TextIOWrapper) and not sys.stdout.isatty():
        # what goes into a file must read back, in whichever locale it was written
        sys.stdout.reconfigure(encoding="utf-8")
    run_program(main)


if __name__ == "__main__":
    program()
