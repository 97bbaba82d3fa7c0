"""Opens the page of the editor on the controller and the cases of an experiment."""

from pathlib import Path

from fis_tools.edit.page import Editor
from fis_tools.edit.server import serve
from fis_tools.edit.session import Session
from pipeline.controllers.source import load
from pipeline.edit.cases import EditorCases
from pipeline.edit.panels import panels
from pipeline.evaluation.assurance.requirements import check_deputies, load_requirements
from pipeline.flight.state.descriptions import with_descriptions
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.experiment import Experiment, SettingError


def open_editor(experiment: Experiment, port: int, *, opens_browser: bool) -> None:
    """Serve the page until Ctrl-C.

    Raises
    ------
    SettingError
        If the controller has no rules.
    """
    controller = load(experiment.controller, experiment.mission).fuzzy
    if controller is None:
        raise SettingError("this controller has no rules to edit; choose one that has, such as champion_27")
    requirements = load_requirements(experiment.assurance.requirements, experiment.mission)
    check_deputies(requirements, experiment.mission)
    cases = EditorCases(experiment, requirements)
    path = Path(str(experiment.controller.get("path", f"{controller.name}.yaml")))
    meanings = {name: kind.description for name, kind in CONSTANTS.items()}

    def page(session: Session) -> None:
        Editor(session, panels(cases, controller), meanings)

    def begin() -> Session:
        return Session(path, controller, cases.ready, with_descriptions)

    serve(begin, page, controller.name, port, opens_browser)
