"""A run whose flights a page plays."""

from dataclasses import dataclass

from pipeline.evaluation.statistics import Columns
from pipeline.flight.control.controller import Controller
from pipeline.settings.experiment import Experiment


@dataclass(frozen=True)
class EvaluatedRun:
    """A run with its evaluation: what beside others it is called, and the command that flies its cases."""

    name: str
    experiment: Experiment
    controller: Controller
    episodes: Columns
    command: str
