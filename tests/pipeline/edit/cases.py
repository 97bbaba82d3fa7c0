"""The champion that is edited, and the flights beside its editor."""

from fis_tools.edit.touches import turned, with_system
from fis_tools.model import FuzzyController
from fis_tools.source import read_controller
from pipeline.command_line.config import compose_experiment
from pipeline.edit import Cases
from pipeline.evaluation.assurance.requirements import read
from pipeline.settings.places import requirements_path
from tests.places import PROJECT

PATH = PROJECT / "conf" / "controller" / "champion_27.yaml"
CHAMPION = read_controller(PATH)


def cases_of(*words: str) -> Cases:
    """The flights of an evaluation of the champion under a random Sun."""
    named = ["+experiment=evaluate", "controller=champion_27", "sun=random", *words]
    text = requirements_path("inspection").read_text(encoding="utf-8")
    return Cases(compose_experiment(named).experiment, read(text, "inspection").requirements)


def pressed(place: int, *rules: int, step: int = 1) -> FuzzyController:
    """The champion with the conclusions of some rules of a system turned to another term."""
    system = CHAMPION.systems[place]
    for rule in rules:
        system = turned(system, rule - 1, "then", 0, step)
    return with_system(CHAMPION, system)
