"""The command ``export_c``: the whole on-board function of a controller as C."""

import sys
from collections.abc import Sequence
from pathlib import Path

from pipeline.command_line import runs
from pipeline.command_line.arguments import CommandParser, ConfigError
from pipeline.command_line.evaluations import parse_evaluation


def export_c(arguments: Sequence[str]) -> int:
    """Write the whole on-board function of a controller as C99, with evidence and wrappers.

    Usage: python -m pipeline export_c controller=NAME [key=value ...] -o FOLDER [--flights N]

    Keys are those of +experiment=evaluate, such as controller=champion_27 or world=leo. The C is translated
    from the Python that flies. The commands of N recorded flights, 3 unless given, are compared bit by bit,
    and stand in the folder as a test vector. The folder must be new or empty.

    Returns
    -------
    int
        The exit code; 1 if a command differs.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser(prog="python -m pipeline export_c", allow_abbrev=False, add_help=False)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FOLDER")
    parser.add_argument("--flights", type=int, default=3, choices=range(1, 10001), metavar="N")
    chosen, experiment = parse_evaluation(parser, arguments)
    folder: Path = chosen.output
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(
            f"{folder} is not empty; give a new folder, for files of earlier exports are not removed"
        )

    from pipeline.controllers.source import load  # noqa: PLC0415 - compiled code, needed once the rest is right
    from pipeline.onboard.export import export  # noqa: PLC0415
    from pipeline.onboard.program import translate  # noqa: PLC0415
    from pipeline.scenarios import evaluation_scenarios  # noqa: PLC0415

    mission = experiment.mission
    program = translate(mission, load(experiment.controller, mission))
    exported = export(program, evaluation_scenarios(experiment)[: chosen.flights], folder)
    source = exported.source
    sys.stdout.write(
        f"{folder / 'controller.c'}: {source.code.count(chr(10))} lines, "
        f"{sum(source.tables.values())} bytes of tables, {source.state_bytes} of state\n"
    )
    if exported.num_different is None:
        sys.stdout.write("not compared with recorded flights, for gcc was not found\n")
        return runs.OK
    sys.stdout.write(
        f"{exported.num_different} of {exported.num_commands} commands of {exported.num_flights} recorded "
        "flights differ from those of this C\n"
    )
    return runs.OK if exported.num_different == 0 else runs.FAULT
