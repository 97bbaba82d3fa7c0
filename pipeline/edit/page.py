"""The editor of a controller, with its mission beside it."""

from collections.abc import Sequence
from pathlib import Path

from fis_tools.edit.page import open_editor
from fis_tools.edit.panels import Panel
from fis_tools.model import FuzzyController
from pipeline.edit.flights import Cases
from pipeline.edit.panels import ManyFlights, OneFlight
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.flight.state.signals import CONSTANTS
from pipeline.settings.experiment import Experiment


def edit(
    path: Path,
    controller: FuzzyController,
    experiment: Experiment,
    requirements: Sequence[Requirement],
    port: int = 0,
    opens: bool = True,
) -> None:
    """Serve the editor until Ctrl-C.

    Parameters
    ----------
    path : Path
        What the controller was read from.
    controller : FuzzyController
    experiment : Experiment
        Its mission and the cases of its evaluation are flown.
    requirements : sequence of Requirement
        Judged by these cases.
    port, opens
        As of `fis_tools.edit.server.serve`.
    """

    def panels() -> Sequence[Panel]:
        cases = Cases(experiment, requirements)
        one = OneFlight(cases, controller)
        return ManyFlights(cases, controller, one.choose), one

    meanings = {name: kind.description for name, kind in CONSTANTS.items()}
    open_editor(path, controller, panels, meanings, port, opens)
