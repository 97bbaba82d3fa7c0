"""A command: a function of its arguments whose docstring is its help."""

import argparse
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from argparse import _SubParsersAction

#: The names and the keywords that `argparse.ArgumentParser.add_argument` takes.
Argument = tuple[tuple[str, ...], dict[str, Any]]
Run = Callable[[argparse.Namespace], int | None]


def argument(*names: str, **keywords: Any) -> Argument:
    """Describe an argument as `argparse.ArgumentParser.add_argument` does."""
    return names, keywords


_SAVE = argument("--save", type=Path, metavar="OUT.rrd", help="write a rerun file; open no window")
_WEB = argument("--web", action="store_true", help="serve a page to a browser on this machine")


@dataclass(frozen=True)
class Command:
    """A command of ``python -m telemetry``.

    Parameters
    ----------
    run : callable
        Takes the parsed arguments; an exit code that is not 0 is returned. It has the command's name, and its
        docstring is the help.
    arguments : tuple of Argument
    examples : sequence of str
        What to type after the command's name.
    opens_viewer : bool
        Whether it takes --save and --web.
    """

    run: Run
    arguments: tuple[Argument, ...]
    examples: Sequence[str]
    opens_viewer: bool

    @property
    def lines(self) -> list[str]:
        """The examples as they are typed."""
        return [f"  python -m telemetry {self.run.__name__} {words}" for words in self.examples]

    def add_to(self, commands: "_SubParsersAction[argparse.ArgumentParser]") -> None:
        """Add a parser for this command."""
        explanation = inspect.getdoc(self.run) or ""
        summary = explanation.partition(".\n")[0]
        parser = commands.add_parser(
            self.run.__name__,
            help=f"{summary[:1].lower()}{summary[1:]}",
            description=explanation,
            epilog="\n".join(["examples:", *self.lines]),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        for names, keywords in self.arguments:
            parser.add_argument(*names, **keywords)
        if self.opens_viewer:
            target = parser.add_mutually_exclusive_group()
            for names, keywords in (_SAVE, _WEB):
                target.add_argument(*names, **keywords)
        parser.set_defaults(run=self.run)


def command(
    *arguments: Argument, examples: Sequence[str], opens_viewer: bool = False
) -> Callable[[Run], Command]:
    """Make a function a `Command`."""
    return lambda run: Command(run, arguments, examples, opens_viewer)
