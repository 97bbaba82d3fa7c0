"""What bounds of rules prove: answers to a requirement's questions about the systems of a controller."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fis_tools.analysis.bounds import ask
from fis_tools.analysis.condition import read_conditions, read_region
from fis_tools.engines.interval import NotBounded
from fis_tools.model import FuzzySystem
from pipeline.array_types import Floats
from pipeline.evaluation.assurance.requirements import Question, Requirement, RequirementError
from pipeline.flight.control.controller import Controller
from pipeline.settings.keys import choices_of


@dataclass(frozen=True)
class Certificate:
    """The answer to a question about a system's outputs, with the boxes that prove a negative one.

    Parameters
    ----------
    question : Question
    system : str
    verdict : str
        ``no`` if it is proved that the outputs cannot, ``yes`` if an example shows that they can,
        ``undecided``, or ``unbounded`` for systems that cannot be bounded.
    sentence : str
        The answer in words.
    inputs : tuple of str
        The columns of the boxes.
    low, high : (n, num_inputs)
        The boxes; none without a proof.
    """

    question: Question
    system: str
    verdict: str
    sentence: str
    inputs: tuple[str, ...]
    low: Floats
    high: Floats


_NAME = re.compile(r"[A-Za-z_]\w*")


def check_questions(requirements: Sequence[Requirement], controller: Controller) -> None:
    """Refuse questions that no system of a controller can answer, unless it has no systems at all.

    Raises
    ------
    RequirementError
        If no system has such an output, or a condition cannot be read.
    """
    if not controller.systems:
        return
    outputs = list(dict.fromkeys(v.name for system in controller.systems for v in system.outputs))
    for requirement in requirements:
        for question in requirement.questions:
            words = f"{requirement.id}, its bounds {question.ask!r}"
            systems = [system for system in controller.systems if _is_about(question, system)]
            if not systems:
                word = next(iter(_NAME.findall(question.ask)), question.ask)
                raise RequirementError(
                    f"{words}: no system of {controller.name} has this output"
                    f"{choices_of(word, outputs, plural='outputs')}"
                )
            for system in systems:
                try:
                    read_conditions(question.ask, [variable.name for variable in system.outputs])
                    read_region(system, question.where)
                except ValueError as error:
                    raise RequirementError(f"{words}: {error}") from error


def certificates(requirement: Requirement, controller: Controller) -> tuple[Certificate, ...]:
    """Answer a requirement's questions about the systems of a controller.

    Raises
    ------
    RequirementError
        If a question cannot be read.
    """
    return tuple(
        _certificate(question, system, requirement.id)
        for question in requirement.questions
        for system in controller.systems
        if _is_about(question, system)
    )


def _is_about(question: Question, system: FuzzySystem) -> bool:
    """Return whether a question names an output of a system."""
    words = set(_NAME.findall(question.ask))
    return any(variable.name in words for variable in system.outputs)


def _certificate(question: Question, system: FuzzySystem, name: str) -> Certificate:
    """Return a system's proved answer to a question, with the boxes that rule out any other."""
    inputs = tuple(variable.name for variable in system.inputs)
    none = np.empty((0, len(inputs)))
    try:
        answer = ask(system, question.ask, question.where)
    except NotBounded as error:
        return Certificate(question, system.name, "unbounded", str(error), inputs, none, none)
    except ValueError as error:
        raise RequirementError(f"{name}, its bounds {question.ask!r}: {error}") from error
    low = none if answer.refuted_low is None else answer.refuted_low
    high = none if answer.refuted_high is None else answer.refuted_high
    return Certificate(question, system.name, answer.verdict, answer.sentence, inputs, low, high)
