"""Other programs as forms of inference: random systems that a file of theirs can say, and what it then says.

The file is read again as a stranger's, without the comment that carries what it has no place for: programs
sample an output at points of their own.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from benchmarks.rivals import programs
from fis_tools.array_types import Floats
from fis_tools.engines import defuzzification
from fis_tools.engines.inference import Inference, infer
from fis_tools.errors import Mistake
from fis_tools.formats import serialize
from fis_tools.formats.exchange import writing
from fis_tools.model import Constant, FuzzyController, FuzzySystem, Linear, Semantics, SigmoidDifference
from tests.fis_tools.agreement import drawn, nearness
from tests.fis_tools.agreement.nearness import Difference
from tests.fis_tools.engines.random_systems import inputs_beyond


@dataclass(frozen=True)
class Rival:
    """A program that reads a kind of file, and how our answers look where it weighs otherwise."""

    program: programs.Program
    ending: str
    semantics: Semantics
    answers_as: programs.Answers = programs.ours
    takes_only_ranges: bool = False
    is_taken: Callable[[FuzzySystem], bool] = lambda system: True

    def cases(
        self, generator: np.random.Generator, count: int, num_rows: int
    ) -> Iterator[tuple[str, FuzzySystem, Floats]]:
        """Yield files of its own that say random systems, what they then are, and inputs of each."""
        for number in range(count):
            text, system = self._sayable(generator, f"drawn {number}")
            rows = inputs_beyond(system, generator, num_rows)
            ranges = np.array([(v.minimum, v.maximum) for v in system.inputs]).T
            yield text, system, np.clip(rows, *ranges) if self.takes_only_ranges else rows

    def _sayable(self, generator: np.random.Generator, name: str) -> tuple[str, FuzzySystem]:
        write = serialize.writer(self.ending)
        while True:
            system = drawn.system(generator, name)
            if system.semantics == self.semantics and self.is_taken(system):
                with suppress(ValueError, Mistake):
                    lines = write(FuzzyController(name, (system,))).text.splitlines(keepends=True)
                    text = "".join(line for line in lines if writing.MARK not in line)
                    return text, serialize.loads(text, self.ending).systems[0]

    def differences(
        self, form: str, text: str, system: FuzzySystem, rows: Floats, folder: Path
    ) -> list[Difference]:
        """Compare its answers with the definition, moved by what it weighs otherwise.

        Raises
        ------
        Missing
            If it does not answer: it is not installed, or cannot run what its file says.
        """
        path = folder / f"case.{self.ending}"
        path.write_text(text, encoding="utf-8")
        steps = [infer(system, row) for row in rows]
        expected = np.array([step.values for step in steps])
        with np.errstate(invalid="ignore"):
            moved = self.program(path, system, rows) - self.answers_as(system, rows) + expected
        given = np.where(np.isfinite(moved), moved, expected)  # without a number it says nothing
        return [
            Difference(form, system, row, str(step.values.tolist()), str(answer.tolist()))
            for row, step, answer in zip(rows, steps, given, strict=True)
            if not (nearness.is_near(system, answer, step) or _is_faint(step) or _is_tie(system, answer, row))
        ]


def _is_faint(inferred: Inference) -> bool:
    """Whether no more than rounding is left of a set, or nothing where programs weigh less than 1e-290."""
    return any(
        output.aggregated.max() < nearness.FAINTEST if len(output.aggregated) else output.is_default
        for output in inferred.outputs
    )


def _is_tie(system: FuzzySystem, answer: Floats, row: Floats) -> bool:
    """Whether an answer is one of several points of equal height or area, by the last digits of these."""
    with patch.object(defuzzification, "TIE", 0.0), patch.object(nearness, "TIES", (0.0,)):
        inferred = infer(system, row)
        if nearness.is_near(system, answer, inferred):
            return True
    halves = [
        0.51 * output.span / (output.num_points - 1) if system.defuzzifier_of(output) == "bisector" else 0.0
        for output in system.outputs
    ]  # of a step: between two points that leave as much on both sides
    return bool((np.abs(answer - inferred.values) <= halves).all())


def _is_matlabs(system: FuzzySystem) -> bool:
    """Whether Octave's toolkit does as MATLAB does, which it does not by its bisector, `som` and `lom`.

    Nor with operators of its own, where these join what rules conclude, with a single rule, or where a
    difference of sigmoids is negative, which is zero there.
    """
    methods = {system.defuzzifier_of(output) for output in system.outputs}
    joins = {output.aggregation for output in system.outputs if not system.weighs(output)}
    shapes = [term.membership for variable in system.variables for term in variable.terms]
    return (
        methods <= {"centroid", "weighted_average"}
        and joins <= {"max"}
        and len(system.rules) > 1
        and not any(isinstance(shape, SigmoidDifference) and shape.is_reversed for shape in shapes)
        and system.implication in {"min", "product"}
    )


def _has_numbers(system: FuzzySystem) -> bool:
    """Whether all that is weighed has values: where it has none, pyfuzzylite concludes the default."""
    terms = [term for output in system.weighed for term in output.terms]
    return all(isinstance(term.membership, Constant | Linear) for term in terms)


def rivals(jfuzzylogic: str = "") -> dict[str, Rival]:
    """Return the programs by name; jFuzzyLogic needs the CLASSPATH of its classes and jars."""
    octave = Rival(programs.octave, "fis", "matlab", programs.as_octave, takes_only_ranges=True)
    known = {
        "Octave": replace(octave, is_taken=_is_matlabs),
        "pyfuzzylite": Rival(programs.pyfuzzylite, "fll", "fuzzylite", is_taken=_has_numbers),
    }
    if jfuzzylogic:
        known["jFuzzyLogic"] = Rival(programs.jfuzzylogic(jfuzzylogic), "fcl", "fcl")
    return known
