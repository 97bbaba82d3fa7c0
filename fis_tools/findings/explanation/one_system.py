"""The explanation of one inference of one system: each rule's share in its outputs, and what flips them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fis_tools.analysis import shapley
from fis_tools.analysis.arrays import FIRED
from fis_tools.analysis.contribution import contributions, holding_back
from fis_tools.analysis.flight_data import Points
from fis_tools.engines.compiler import CompiledSystem
from fis_tools.engines.inference import infer
from fis_tools.findings.explanation.flips import ClassFlip, Flip, class_flips, flips, is_classifier
from fis_tools.findings.explanation.points import made_of, plain_parts
from fis_tools.model import FuzzySystem, Variable
from fis_tools.words.text import NEGLIGIBLE, amount, inferred_as, listed, percent, sentence, signed
from plain_files.document import Block, Document, Heading, Items, Paragraph, Result, Table, plain

#: Rules that moved an output by less than this fraction of its range, or beyond so many, are told on demand.
WORTH_TELLING = 0.01
MOST_RULES = 8
#: What rounding may add to a part of a whole.
SURPLUS = 1e-9
#: An output that changes by more than this share of its range at a flip jumps there.
JUMP = 1e-3
#: A change of less than this share of an input's range is any change at all.
ANY_CHANGE = 1e-7

#: what is needed of a rule without which there is no output
ALL = "all"
#: what is said in place of a class where the defaults alone, which may be equal, decide
BY_DEFAULT = "the default, as no rule fires"


@dataclass(frozen=True)
class Move:
    """The effect of one rule on one output.

    Parameters
    ----------
    rule : int
        The rule's number, from 1 as in every listing.
    strength : float
        How strongly it fires, before weights.
    share : float
        Its part of the output's way from its default, in the output's unit; the parts of all rules add up.
    needed : float
        What would be missing without it: the output minus the output without the rule, in the output's unit.
    least : float, optional
        Of an interval type-2 system: its least strength; `strength` is the greatest.
    """

    rule: int
    strength: float
    share: float
    needed: float
    least: float | None = None

    @property
    def strength_words(self) -> str:
        """Its strength, or the least and the greatest."""
        least = "" if self.least is None else f"{self.least:.2f} to "
        return f"{least}{self.strength:.2f}"


@dataclass(frozen=True)
class ExplainedOutput:
    """Why one output is what it is.

    Parameters
    ----------
    variable : Variable
    value : float
    is_default : bool
        Whether no rule that concludes on it fires.
    moves : tuple of Move
        The rules that fire and conclude on it, the largest share first.
    error : float
        The largest standard error of the shares; 0 where they are exact.
    holding : frozenset of int
        The numbers of the rules that conclude the default, and so hold back whatever their shares.
    crossing : float
        The value that the flips are about.
    flips : tuple of Flip
        The smallest changes first.
    is_in_range : bool
        Whether it lies in its range whatever the inputs: a mean of points does, what rules conclude as
        numbers, or a default, may not.
    """

    variable: Variable
    value: float
    is_default: bool
    moves: tuple[Move, ...]
    error: float
    holding: frozenset[int]
    crossing: float
    flips: tuple[Flip, ...]
    is_in_range: bool = True


@dataclass(frozen=True, repr=False)
class Explanation(Result):
    """Why a system gives its outputs.

    Parameters
    ----------
    system : FuzzySystem
    inputs : tuple of float
        As given, in the order of the system's inputs.
    outputs : tuple of ExplainedOutput
    class_flips : tuple of ClassFlip
        What flips the class that a classifier says, the smallest changes first.
    points : Points, optional
        Which points the inputs are made of, where that is known.
    """

    system: FuzzySystem
    inputs: tuple[float, ...]
    outputs: tuple[ExplainedOutput, ...]
    class_flips: tuple[ClassFlip, ...] = ()
    points: Points | None = None

    def document(self, *, everything: bool = False) -> Document:
        """Render the explanation, what matters most first; `everything` adds rules with hardly any effect."""
        blocks: list[Block] = [
            Heading(f"{self.system.name} at {self._inputs_in_words()}{inferred_as(self.system.semantics)}")
        ]
        for output in self.outputs:
            rows, rest = self._moves(output, everything)
            blocks += [Paragraph(_value(output)), Items(self.conclusions(output))]
            blocks += (
                [Table(["share", "needed", "strength", "rule"], rows, numbers=(0, 1, 2))] if rows else []
            )
            blocks += [Paragraph(rest)] if rest else []
            blocks += [Paragraph(words) for words in _without_shares(output)]
            blocks += [] if is_classifier(self.system) else crossing_blocks(output)
        if is_classifier(self.system):
            blocks += self._class_words()
        if self.points is not None:
            blocks += made_of(self.points, self.system, self.inputs, everything)
        return Document([block for block in blocks if block != Items([])])

    def _class_words(self) -> Iterator[Block]:
        """Yield which class wins, and what would flip it."""
        winner = max(self.outputs, key=lambda output: output.value).variable.name
        if all(output.is_default for output in self.outputs):
            winner = BY_DEFAULT
        if not self.class_flips:
            yield Paragraph(f"Class: {winner}. No change of one input alone flips it.")
            return
        yield Paragraph(f"Class: {winner}. What would flip it, one input changed alone:")
        yield Items(
            [
                f"{BY_DEFAULT if flip.takes_default else flip.other.name}: {flip.input.name} "
                f"{'above' if flip.first > flip.given else 'below'} {amount(flip.input, flip.first)}, "
                f"a change of {percent(flip.share) if flip.share <= 1.0 else 'more than all'} of its range"
                for flip in self.class_flips
            ]
        )

    def plain(self) -> dict[str, Any]:
        """Return the explanation as plain JSON data; numbers are in the units of their variables.

        Keys are ``system``, ``inputs`` (by name, as given) and ``outputs``; of each ``output`` its ``unit``,
        ``value``, whether that is its ``default``, the ``rules`` that fire, the greatest share first (number,
        ``sentence``, ``strength``, ``share``, ``needed``, and whether it concludes the default and so
        ``holds_back``), the ``error`` of the shares (0 where they are exact), the ``silent`` value that they
        count from, and what takes it across ``crossing``: ``flips``, an entry for each ``input`` and ``way``
        (``up``, ``down``), the smallest first, with the ``change``,
        the inputs ``last`` before and ``first`` after it and the outputs there (null where no value does it),
        and whether no rule fires there (``takes_default``). Where inputs are made of points, ``points`` says
        what each adds to them.
        """
        names = [variable.name for variable in self.system.inputs]
        class_flips = [
            {"input": flip.input.name, "first": flip.first, "class": flip.other.name}
            | {"takes_default": flip.takes_default}
            for flip in self.class_flips
        ]
        return {
            "system": self.system.name,
            "inputs": dict(zip(names, self.inputs, strict=True)),
            "outputs": [
                plain_output(
                    output,
                    default=output.is_default,
                    rules=[
                        {key: value for key, value in plain(move).items() if value is not None}
                        | {"sentence": sentence(self.system.rules[move.rule - 1])}
                        | {"holds_back": move.rule in output.holding}
                        for move in output.moves
                    ],
                    error=output.error,
                    silent=output.variable.default,
                )
                for output in self.outputs
            ],
            **({"class_flips": class_flips} if class_flips else {}),
            **({"points": plain_parts(self.points, self.system)} if self.points is not None else {}),
        }

    def _inputs_in_words(self) -> str:
        """Return the inputs with their values, and what those outside a range are taken as."""
        words = []
        for variable, given in zip(self.system.inputs, self.inputs, strict=True):
            low, high = self.system.limits_of(variable)
            end = min(max(given, low), high)
            note = f" (taken as {amount(variable, end)}, the end of its range)" if end != given else ""
            words.append(f"{variable.name} = {amount(variable, given)}{note}")
        return ", ".join(words)

    def conclusions(self, output: ExplainedOutput) -> list[str]:
        """Return a sentence for each conclusion: its contribution, that as a share of all, and its rules."""
        name = output.variable.name
        groups: dict[str, list[Move]] = {}
        for move in output.moves:
            consequents = self.system.rules[move.rule - 1].consequents
            terms = dict.fromkeys(c.term for c in consequents if c.variable == name and c.weight > 0.0)
            groups.setdefault(" and ".join(terms), []).append(move)
        whole = output.value - (output.variable.default or 0.0)
        shared = {term: sum(move.share for move in moves) for term, moves in groups.items()}
        # where conclusions pull apart, a part of the whole can be negative or more than all of it
        are_parts = whole != 0.0 and all(0.0 <= share / whole <= 1.0 + SURPLUS for share in shared.values())
        sentences = []
        for term in sorted(groups, key=lambda term: -abs(shared[term])):
            least = NEGLIGIBLE * output.variable.span
            who = [str(move.rule) for move in groups[term] if abs(move.share) > least]
            if who:
                holds = all(move.rule in output.holding for move in groups[term])
                words = f"rule {who[0]} {'holds back' if holds else 'says so'}"
                if len(who) > 1:
                    does = "hold back" if holds else "say so"
                    words = f"rules {listed(who, MOST_RULES)} {does} together"
                of_all = f" ({percent(min(1.0, shared[term] / whole))})" if are_parts else ""
                sentences.append(f"{term}, {signed(output.variable, shared[term])}{of_all}: {words}")
        return sentences

    def _moves(self, output: ExplainedOutput, everything: bool) -> tuple[list[list[str]], str]:
        """Return the listed rules as cells, and a sentence on the others."""
        variable, moves = output.variable, output.moves
        shown = [move for move in moves if abs(move.share) >= WORTH_TELLING * variable.span][:MOST_RULES]
        shown = list(moves) if everything else shown or list(moves[:1])
        rows = []
        for move in shown:
            needed = ALL if np.isnan(move.needed) else signed(variable, move.needed)
            amounts = [signed(variable, move.share), needed]
            words = f"{move.rule}. {sentence(self.system.rules[move.rule - 1])}"
            rows.append([*amounts, move.strength_words, words])
        rest = moves[len(shown) :]
        if not rest:
            return rows, ""
        fire = "1 more rule fires, with" if len(rest) == 1 else f"{len(rest)} more rules fire, each with"
        most = abs(rest[0].share)
        share = f"{amount(variable, most)} at most" if most > NEGLIGIBLE * variable.span else "no share"
        return rows, f"{fire} {share}"


def stays_in_range(system: FuzzySystem, output: Variable) -> bool:
    """Return whether an output lies in its range whatever the inputs."""
    silent = output.minimum if output.default is None else output.default
    return not system.weighs(output) and output.minimum <= silent <= output.maximum


def crossing_blocks(output: ExplainedOutput) -> list[Block]:
    """Return what would take an output across; nothing about a sign that it cannot have."""
    is_inside = output.variable.minimum < output.crossing < output.variable.maximum
    if not is_inside and output.crossing == 0.0 and all(flip.change is None for flip in output.flips):
        return []
    return [Paragraph(f"{_question(output)}:"), Items(list(_flip_words(output)))]


def _question(output: ExplainedOutput) -> str:
    """Return the question that an output's flips answer, such as “What would make it negative”."""
    name, side = output.variable.name, output.flips[0].side
    value = amount(output.variable, output.crossing)
    if side == 0:
        does = f"move {name} away from {value}"
    elif output.crossing == 0.0:
        does = f"make {name} {'negative' if side > 0 else 'positive'}"
    else:
        does = f"take {name} {'below' if side > 0 else 'above'} {value}"
    return f"What would {does}, one input changed alone"


def _value(output: ExplainedOutput) -> str:
    """Return an output's value in words, and how far rules moved it."""
    value = f"{output.variable.name} = {amount(output.variable, output.value)}"
    if output.is_default:
        fires = any(move.strength > 0.0 for move in output.moves)
        why = (
            "its defuzzifier finds none in what rules conclude"
            if fires
            else "no rule that concludes on it fires"
        )
        return f"{value}, its default: {why}"
    variable, silent = output.variable, output.variable.default or 0.0
    start = "where no rule fires"
    if variable.default is None:
        start = "from which shares count, as there is no output where no rule fires"
    words = f"{signed(variable, output.value - silent)} from {amount(variable, silent)}, {start}"
    sampled = f", sampled with a standard error of {amount(variable, output.error)} at most"
    return f"{value}: {words}. By shares{sampled if output.error else ''}:"


def _without_shares(output: ExplainedOutput) -> Iterator[str]:
    """Say which rules matter though they fire too weakly to play, see `fis_tools.analysis.shapley`."""
    least = NEGLIGIBLE * output.variable.span
    weak = [move for move in output.moves if move.strength < FIRED and abs(move.needed) > least]
    without = [str(move.rule) for move in sorted(weak, key=lambda move: move.rule) if move.share == 0.0]
    if without:
        does = "rule {} fires at less than {:g} and so has" if len(without) == 1 else ""
        does = does or "rules {} fire at less than {:g} and so have"
        words = does.format(listed(without, MOST_RULES), FIRED)
        yield f"{words} no share of their own: what they do counts in the shares of the others"


def _flip_words(output: ExplainedOutput) -> Iterator[str]:
    """Yield the flips in words, the smallest change first, then the inputs that cannot cause one."""
    variable, crossing = output.variable, output.crossing
    is_inside = variable.minimum < crossing < variable.maximum or not output.is_in_range
    if not is_inside and all(f.change is None for f in output.flips):
        yield (
            f"nothing can: {variable.name} lies between {amount(variable, variable.minimum)} and "
            f"{amount(variable, variable.maximum)}, on one side of {amount(variable, crossing)}"
        )
        return
    if all(flip.change is None for flip in output.flips):
        yield "no value of any one input does"
        return
    for flip in output.flips:
        if flip.change is None or flip.first is None:
            continue
        far = f"{amount(flip.input, abs(flip.change))}, to {amount(flip.input, flip.first)}"
        # from beyond its range an input may change by more than all of it
        share = f" ({percent(flip.share)} of its range)" if flip.share <= 1.0 else ""
        size = "any change" if flip.share <= ANY_CHANGE else f"{far}{share}"
        yield f"{flip.input.name} {flip.direction} by {size}{_landing(flip)}"
    for name in dict.fromkeys(flip.input.name for flip in output.flips):
        stuck = [flip for flip in output.flips if flip.input.name == name and flip.change is None]
        if len(stuck) == 2:
            variable = stuck[0].input
            extent = f"from {amount(variable, variable.minimum)} to {amount(variable, variable.maximum)}"
            yield f"{name} alone cannot: no value {extent} does"


def _landing(flip: Flip) -> str:
    """Return where an output lands after a flip: at its default, or beyond a jump; else nothing."""
    if flip.output_at_first is None or flip.output_at_last is None:
        return ""
    if flip.takes_default:
        return f"; there no rule fires, and it takes its default, {amount(flip.output, flip.output_at_first)}"
    if abs(flip.output_at_first - flip.output_at_last) > JUMP * flip.output.span:
        jump = f"{amount(flip.output, flip.output_at_last)} to {amount(flip.output, flip.output_at_first)}"
        return f"; there it jumps from {jump}"
    return ""


def plain_output(output: ExplainedOutput, **more: Any) -> dict[str, Any]:
    """Return an output as plain data: its value, what more is said of it, and its flips."""
    value = {"output": output.variable.name, "unit": output.variable.unit, "value": output.value}
    return value | more | {"crossing": output.crossing, "flips": [_plain_flip(flip) for flip in output.flips]}


def _plain_flip(flip: Flip) -> dict[str, Any]:
    """Return a flip as plain data."""
    keys = ("last", "first", "output_at_last", "output_at_first", "takes_default", "change")
    return {
        "input": flip.input.name,
        "unit": flip.input.unit,
        "way": flip.direction,
        **{name: getattr(flip, name) for name in keys},
    }


def explain_system(
    compiled: CompiledSystem, inputs: ArrayLike | Mapping[str, float], crossing: float, points: Points | None
) -> Explanation:
    """Explain one inference of a compiled system; see `fis_tools.findings.explanation.explain`."""
    inference = infer(compiled.system, inputs)
    given = inference.inputs
    for output in inference.outputs:
        if not np.isfinite(output.value):
            raise ValueError(
                f"{output.variable.name} is {output.value} there: a formula that a rule concludes has no "
                "value; ask at other inputs"
            )
    shared, error = shapley.shares(compiled, given[np.newaxis])
    needed = contributions(compiled, given[np.newaxis])
    all_flips = flips(compiled, given, crossing)
    outputs = []
    for index, output in enumerate(inference.outputs):
        strengths = inference.firing_strengths
        concluding_rules = {
            rule for rule, c in compiled.system.conclusions_on(output.variable) if c.weight > 0.0
        }
        concluding = [number for number in sorted(concluding_rules) if strengths[number] > 0.0]
        numbers = np.column_stack([strengths, shared[0, :, index], needed[0, :, index]])
        lower = inference.lower_strengths
        moves = []
        for number in concluding:
            strength, share, missing = numbers[number].tolist()
            least = None if lower is None else float(lower[number])
            moves.append(Move(number + 1, strength, share, missing, least))
        moves.sort(key=lambda move: (-abs(move.share), -move.strength))
        of_output = tuple(flip for flip in all_flips if flip.output == output.variable)
        reasons = (tuple(moves), float(error[0, index]), frozenset(holding_back(compiled.system, index)))
        value = (output.variable, output.value, output.is_default)
        is_in_range = stays_in_range(compiled.system, output.variable)
        outputs.append(ExplainedOutput(*value, *reasons, float(crossing), of_output, is_in_range))
    turned = class_flips(compiled, given) if is_classifier(compiled.system) else ()
    return Explanation(compiled.system, tuple(given.tolist()), tuple(outputs), turned, points)
