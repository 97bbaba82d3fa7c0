"""Compare all forms of inference with the plain definition, and what is claimed about outputs with these."""

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

from fis_tools.array_types import Floats
from fis_tools.engines.inference import Inference, infer
from fis_tools.model import FuzzySystem
from tests.fis_tools.agreement.claims import CLAIMS
from tests.fis_tools.agreement.forms import FORMS, Case
from tests.fis_tools.agreement.nearness import Difference, is_near

#: the name under which the definition's own errors are told
DEFINITION = "definition"


def differences(
    cases: Sequence[Case], folder: Path, forms: Sequence[str] = (*FORMS, *CLAIMS)
) -> list[Difference]:
    """Compare all forms with the definition, and what is claimed about outputs with the outputs.

    An error of the definition itself is a difference, and its system is left out of the rest.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        differing, inferred, answered = list[Difference](), list[list[Inference]](), list[Case]()
        for system, rows in cases:
            steps = [_defined(system, row) for row in rows]
            if errors := [step for step in steps if isinstance(step, Difference)]:
                differing.append(errors[0])
            else:
                inferred.append([step for step in steps if isinstance(step, Inference)])
                answered.append((system, rows))
        cases = answered
        for form in forms:
            if form in FORMS:
                answers = _answers(form, cases, folder)
                for (system, rows), steps, given in zip(cases, inferred, answers, strict=True):
                    if isinstance(given, Exception):
                        differing.append(Difference(form, system, rows[0], "an answer", repr(given)))
                    elif given is not None:
                        differing += _of_form(form, system, rows, steps, given)
        for claim, check in CLAIMS.items():
            if claim in forms:
                for (system, rows), steps in zip(cases, inferred, strict=True):
                    try:
                        differing += check(claim, system, rows, steps)
                    except Exception as error:  # noqa: BLE001 - as above
                        differing.append(Difference(claim, system, rows[0], "an answer", repr(error)))
    return differing


def _defined(system: FuzzySystem, row: Floats) -> Inference | Difference:
    try:
        return infer(system, row)
    except Exception as error:  # noqa: BLE001 - it is a finding, whatever it is
        return Difference(DEFINITION, system, row, "an answer", repr(error))


def _answers(form: str, cases: Sequence[Case], folder: Path) -> list[Floats | Exception | None]:
    """Ask a form for all systems together; where that ends in an error, for each by itself."""
    try:
        return [*FORMS[form](cases, folder)]
    except Exception as error:  # noqa: BLE001 - it is a finding, whatever it is
        if len(cases) == 1:
            return [error]
        return [answer for case in cases for answer in _answers(form, [case], folder)]


def _of_form(
    form: str, system: FuzzySystem, rows: Floats, steps: list[Inference], given: Floats
) -> Iterator[Difference]:
    for row, step, answer in zip(rows, steps, given, strict=True):
        if not is_near(system, answer, step):
            yield Difference(form, system, row, str(step.values.tolist()), str(answer.tolist()))
