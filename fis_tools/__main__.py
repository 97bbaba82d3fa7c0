"""The command line: show, draw, export and explain fuzzy controllers."""

import argparse
import csv
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from fis_tools import analysis, flights, serialize
from fis_tools.formats import csv as csv_format
from fis_tools.formats import markdown, text
from fis_tools.inference import Floats, infer
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.validate import ControllerFileError, nearest

CHAMPION = "champion.json"
PICTURES = (".png", ".svg", ".pdf")
EXPORTS: dict[str, Callable[[FuzzyController], str]] = {
    "markdown": markdown.write,
    "csv": csv_format.write,
    "text": text.write,
    "json": serialize.dump_json,
    "yaml": serialize.dump_yaml,
}

CONTROLLER_HELP = (
    "a controller file (.json, .yaml), the folder of a run (its champion.json), or a logged flight (.mcap)"
)
EPILOG = """\
examples:
  python -m fis_tools show outputs/train/20250101-120000-000000
  python -m fis_tools plot controller.yaml -o figures
  python -m fis_tools explain controller.yaml --inputs distance=80,velocity_body_x=0.05
  python -m fis_tools explain episodes/best.mcap --time 600
  python -m fis_tools firing episodes/*.mcap
  python -m fis_tools export controller.yaml --format markdown > controller.md

`python -m fis_tools COMMAND --help` tells more about each command.
"""


class UserMistake(ValueError):  # noqa: N818
    """What the person at the keyboard can put right, told in a sentence."""


# The commands.


def show(arguments: argparse.Namespace) -> None:
    """Print terms and rule tables."""
    controller = _chosen(read_controller(arguments.controller), arguments.system)
    print(text.describe(controller), end="")


def plot(arguments: argparse.Namespace) -> None:
    """Draw every system of a controller into a folder."""
    from fis_tools.render import system_figures  # noqa: PLC0415 - the other commands start without matplotlib

    controller = _chosen(read_controller(arguments.controller), arguments.system)
    for system in controller.systems:
        for name, figure in system_figures(system):
            file_name = f"{_file_name(system.name)}-{_file_name(name)}.{arguments.format}"
            path = _place_for(Path(arguments.output) / file_name)
            figure.savefig(path, dpi=150)
            print(path)


def surface(arguments: argparse.Namespace) -> None:
    """Evaluate an output over two inputs: a table of numbers, or a picture."""
    system = _the_system(read_controller(arguments.controller), arguments.system)
    fixed = _assignments(arguments.fixed)
    x, y, of, num_points = arguments.x, arguments.y, arguments.of, arguments.points
    try:
        result = analysis.surface(system, x, y, fixed=fixed, output=of, num_points=num_points)
    except ValueError as error:
        raise UserMistake(str(error)) from error
    if arguments.output is None or Path(arguments.output).suffix not in PICTURES:
        _write(arguments.output, _surface_csv(result))
        return
    from fis_tools.render import one_panel, surface_map  # noqa: PLC0415 - as in `plot`

    figure, ax = one_panel(system.name)
    surface_map(system, ax, x, y, fixed=fixed, output=of, num_points=num_points)
    figure.savefig(_place_for(Path(arguments.output)), dpi=150)


def export(arguments: argparse.Namespace) -> None:
    """Write a controller in another form."""
    controller = _chosen(read_controller(arguments.controller), arguments.system)
    _write(arguments.output, EXPORTS[arguments.format](controller))


def explain(arguments: argparse.Namespace) -> None:
    """Tell an inference step by step."""
    told = [text.explain(infer(system, inputs)) for system, inputs in _samples(arguments)]
    print("\n".join(told), end="")


def firing(arguments: argparse.Namespace) -> None:
    """Print which rules fired along logged flights."""
    usages = flights.usage_along(arguments.flights, arguments.threshold)
    controller = _chosen(flights.read_controller(arguments.flights[0]), arguments.system)
    blocks = []
    for system in controller.systems:
        if system.name not in usages:
            blocks.append([f"{system.name}: it never decided anything on these flights"])
            continue
        usage = usages[system.name]
        order = np.argsort(-usage.fired, kind="stable")
        rows = [["fired", "leading", "mean", "max", "rule"]]
        for place in order:
            numbers = (usage.fired[place], usage.leading[place])
            strengths = (usage.mean_strength[place], usage.max_strength[place])
            rows.append(
                [
                    *(f"{100 * number:5.1f} %" for number in numbers),
                    *(f"{number:.2f}" for number in strengths),
                    f"{place + 1}. {text.sentence(system.rules[place])}",
                ]
            )
        idle = int(np.count_nonzero(usage.fired == 0))
        head = (
            f"{system.name}: {usage.num_samples} inferences; {idle} of {len(system.rules)} rules never fire "
            f"at {arguments.threshold:g} or more"
        )
        blocks.append([head, *text.aligned(rows, 2)])
    print("\n\n".join("\n".join(block) for block in blocks))


# What they are made of.


def read_controller(path_text: str) -> FuzzyController:
    """Read a controller from a controller file, a run's folder or a logged flight.

    Raises
    ------
    ControllerFileError
        If there is none that can be read.
    """
    path = Path(path_text)
    if not path.suffix and not path.exists():
        raise ControllerFileError(
            f"{path}: cannot be read (no such file or directory), and a bare name is not looked up; give the "
            f"path of a controller file, such as FOLDER/{path.name}.yaml, of a run's folder or of a logged "
            "flight (.mcap)"
        )
    if path.is_dir():
        if not (path / CHAMPION).is_file():
            raise ControllerFileError(
                f"{path} is a folder without {CHAMPION}; give the folder of a run that has trained, or a file"
            )
        return serialize.load(path / CHAMPION)
    if path.suffix == ".mcap":
        return flights.read_controller(path)
    return serialize.load(path)


def _chosen(controller: FuzzyController, name: str | None) -> FuzzyController:
    if name is None:
        return controller
    names = [system.name for system in controller.systems]
    if name not in names:
        raise UserMistake(f"controller {controller.name!r} has no system {name!r}; {nearest(name, names)}")
    systems = tuple(system for system in controller.systems if system.name == name)
    return FuzzyController(controller.name, systems, controller.attributes, controller.provenance)


def _the_system(controller: FuzzyController, name: str | None) -> FuzzySystem:
    systems = _chosen(controller, name).systems
    if len(systems) > 1:
        names = ", ".join(system.name for system in systems)
        raise UserMistake(f"controller {controller.name!r} has several systems; add --system, one of {names}")
    return systems[0]


def _assignments(words: str) -> dict[str, float]:
    values = {}
    for word in filter(None, (word.strip() for word in words.split(","))):
        name, equals, number = word.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            equals = ""
        if not equals or values[name.strip()] != values[name.strip()]:
            raise UserMistake(f"{word!r} gives no input a number; write NAME=NUMBER,NAME=NUMBER")
    return values


def _samples(arguments: argparse.Namespace) -> Iterator[tuple[FuzzySystem, Floats]]:
    """Yield each system to explain with its inputs, given by hand or logged."""
    if arguments.time is None:
        yield from _given(arguments)
        return
    if Path(arguments.controller).suffix != ".mcap":
        raise UserMistake("--time is for logged flights (.mcap); give --inputs for a controller file")
    flown_systems = flights.read_flight(arguments.controller)
    names = [flown.system.name for flown in flown_systems]
    if arguments.system is not None and arguments.system not in names:
        raise UserMistake(
            f"the flight has no system {arguments.system!r}; {nearest(arguments.system, names)}"
        )
    span = flights.span_of_inference(flown_systems)
    if span is not None and not arguments.time <= span[1]:
        raise UserMistake(
            f"--time {arguments.time:g} is not on this flight, whose inferences cover "
            f"{span[0]:g} to {span[1]:g} s; choose a time among these"
        )
    for flown in flown_systems:
        if arguments.system in (None, flown.system.name):
            place = int(np.searchsorted(flown.time_s, arguments.time, side="right")) - 1
            if place < 0:
                raise UserMistake(f"{flown.system.name!r} decided nothing up to {arguments.time:g} s")
            yield flown.system, flown.inputs[place]


def _given(arguments: argparse.Namespace) -> Iterator[tuple[FuzzySystem, Floats]]:
    controller = _chosen(read_controller(arguments.controller), arguments.system)
    values = _assignments(arguments.inputs or "")
    known = list(dict.fromkeys(v.name for system in controller.systems for v in system.inputs))
    for name in values:
        if name not in known:
            raise UserMistake(f"there is no input {name!r}; {nearest(name, known)}")
    complete = [s for s in controller.systems if all(variable.name in values for variable in s.inputs)]
    if not complete:
        needs = "; ".join(f"{s.name} needs {', '.join(v.name for v in s.inputs)}" for s in controller.systems)
        raise UserMistake(
            "the inputs of no system are all given; add --inputs NAME=NUMBER,… "
            f"(or --time for a flight): {needs}"
        )
    for system in complete:
        yield system, np.array([values[variable.name] for variable in system.inputs])


def _surface_csv(result: analysis.Surface) -> str:
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow([result.x_variable.name, result.y_variable.name, result.output.name])
    for (row, column), value in np.ndenumerate(result.values):
        writer.writerow([repr(float(number)) for number in (result.x[column], result.y[row], value)])
    return lines.getvalue()


def _file_name(name: str) -> str:
    return re.sub(r"[^\w.-]+", "_", name).strip(".") or "_"


def _place_for(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _write(output: str | None, content: str) -> None:
    if output is None:
        print(content, end="")
    else:
        _place_for(Path(output)).write_text(content, encoding="utf-8")


# The parser.


def build_parser() -> argparse.ArgumentParser:
    """Build the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m fis_tools",
        description="Review a fuzzy controller: look at it, draw it, and ask why it does what it does.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)

    _add(commands, "show", show, "print variables, terms and rule tables")

    command = _add(
        commands, "plot", plot, "draw membership functions, rule tables and surfaces into a folder"
    )
    command.add_argument(
        "-o", "--output", metavar="DIR", default=".", help="folder for the pictures (default: here)"
    )
    command.add_argument("--format", choices=["png", "svg", "pdf"], default="png", help="default: png")

    command = _add(
        commands, "surface", surface, "evaluate an output over two inputs, as numbers or a picture"
    )
    command.add_argument("--x", metavar="INPUT", help="input along x (default: the first that is free)")
    command.add_argument("--y", metavar="INPUT", help="input along y (default: the next that is free)")
    command.add_argument("--of", metavar="OUTPUT", help="which output (default: the first)")
    command.add_argument(
        "--fixed",
        metavar="NAME=NUMBER,…",
        default="",
        help="other inputs (default: the middle of their ranges)",
    )
    command.add_argument("--points", type=_count, default=61, help="along each axis (default: 61)")
    command.add_argument(
        "-o", "--output", metavar="FILE", help=".png, .svg, .pdf, or CSV (default: CSV, printed)"
    )

    command = _add(commands, "export", export, "write a controller as Markdown, CSV, sentences, JSON or YAML")
    command.add_argument("--format", choices=sorted(EXPORTS), required=True, help="what to write")
    command.add_argument("-o", "--output", metavar="FILE", help="where to (default: printed)")

    command = _add(commands, "explain", explain, "tell an inference step by step: why this output?")
    sample = command.add_mutually_exclusive_group()
    sample.add_argument(
        "--inputs", metavar="NAME=NUMBER,…", help="the inputs, in the units that `show` prints"
    )
    sample.add_argument(
        "--time", type=float, metavar="SECONDS", help="of a logged flight: its inputs at this time"
    )

    command = commands.add_parser("firing", help="print which rules fired along logged flights")
    command.set_defaults(run=firing)
    command.add_argument(
        "flights", nargs="+", metavar="FLIGHT", help="logged flights (.mcap) of one controller"
    )
    command.add_argument("--system", metavar="NAME", help="only this system")
    command.add_argument(
        "--threshold",
        type=float,
        default=analysis.FIRED,
        help=f"a rule counts as fired from this strength on (default: {analysis.FIRED:g})",
    )
    return parser


def _add(
    commands: "argparse._SubParsersAction[argparse.ArgumentParser]",
    name: str,
    run: Callable[[argparse.Namespace], None],
    summary: str,
) -> argparse.ArgumentParser:
    command = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:])
    command.set_defaults(run=run)
    command.add_argument("controller", metavar="CONTROLLER", help=CONTROLLER_HELP)
    command.add_argument("--system", metavar="NAME", help="only this system of the controller")
    return command


def _count(word: str) -> int:
    if not word.isdecimal() or not 2 <= int(word) <= 1000:
        raise argparse.ArgumentTypeError(f"{word!r} is no whole number from 2 to 1000")
    return int(word)


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return 0, or 2 for a mistake that one sentence explains."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
    parser = build_parser()
    if not (sys.argv[1:] if words is None else words):
        parser.print_help()
        return 2
    arguments = parser.parse_args(words)
    try:
        arguments.run(arguments)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as mistake:
        place = mistake.filename or "the output"
        print(f"error: {place} cannot be written ({mistake.strerror}); choose another place", file=sys.stderr)
        return 2
    except (ControllerFileError, UserMistake) as mistake:
        print(f"error: {mistake}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
