"""The command ``edit``: a page on which a controller is edited, and flown anew at each touch."""

from collections.abc import Sequence
from pathlib import Path

from fis_tools.errors import MissingExtra
from pipeline.command_line import runs
from pipeline.command_line.arguments import CommandParser, ConfigError
from pipeline.command_line.evaluations import parse_evaluation


def edit(arguments: Sequence[str]) -> int:
    """Open a page on which rules and terms change, and each touch flies 1,000 paired cases anew.

    Usage: python -m pipeline edit [key=value ...] [--port PORT] [--no-browser]

    Keys are those of +experiment=evaluate, such as controller=champion_27, world=leo or sun=random. Ctrl-C
    ends it. Nothing is written but the copy that you save.

    Raises
    ------
    ValueError, OSError
        User errors.
    """
    parser = CommandParser(prog="python -m pipeline edit", allow_abbrev=False, add_help=False)
    parser.add_argument("--port", type=int, default=0, choices=range(1 << 16), metavar="PORT")
    parser.add_argument("--no-browser", action="store_true")
    chosen, experiment = parse_evaluation(parser, arguments)

    from pipeline.controllers.source import load  # noqa: PLC0415 - compiled code, needed once the rest is right

    try:
        from fis_tools.edit.server import serve  # noqa: PLC0415 - the other commands do without a server
    except MissingExtra as error:
        raise ConfigError(str(error)) from error
    from fis_tools.edit.page import Editor  # noqa: PLC0415
    from fis_tools.edit.session import Session  # noqa: PLC0415
    from pipeline.edit.cases import EditorCases  # noqa: PLC0415 - compiled code
    from pipeline.edit.panels import panels  # noqa: PLC0415
    from pipeline.evaluation.assurance.requirements import load_requirements  # noqa: PLC0415 - compiled code
    from pipeline.flight.state.descriptions import with_descriptions  # noqa: PLC0415
    from pipeline.flight.state.signals import CONSTANTS  # noqa: PLC0415

    controller = load(experiment.controller, experiment.mission).fuzzy
    if controller is None:
        raise ConfigError("this controller has no rules to edit; choose one that has, such as champion_27")
    cases = EditorCases(experiment, load_requirements(experiment.assurance.requirements))
    path = Path(str(experiment.controller.get("path", f"{controller.name}.yaml")))
    meanings = {name: kind.description for name, kind in CONSTANTS.items()}

    def page(session: Session) -> None:
        Editor(session, panels(cases, controller), meanings)

    serve(
        lambda: Session(path, controller, cases.ready, with_descriptions),
        page,
        controller.name,
        chosen.port,
        not chosen.no_browser,
    )
    return runs.OK
