"""What readers of other programs' files share: numbers, choices, shapes and tables of points.

Everything that is wrong in a file is reported with the place where it stands.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence, Sized
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TypeVar

import numpy as np

from fis_tools import model
from fis_tools.errors import ControllerFileError, suggestion
from fis_tools.formats.exchange.dialect import INPUT_POINTS, OUTPUT_POINTS, input_universe
from fis_tools.formats.exchange.vocabulary import HEDGES
from fis_tools.formats.mapping import MOST_POINTS
from fis_tools.model import MembershipFunction, Semantics, Term, Trapezoidal, Variable, with_universe
from fis_tools.model.membership import Format, words_of
from fis_tools.model.numbers import FUNCTIONS, NotAFormula, linear
from fis_tools.model.validate import LONGEST_NAME, MOST_RULES, MOST_TERMS
from fis_tools.words.text import antecedent_words, before

_Choice = TypeVar("_Choice")

_TOO_LONG = re.compile(rf"(?<![^\s,;:=|()\[\]{{}}'\"])[^\s,;:=|()\[\]{{}}'\"]{{{LONGEST_NAME + 1}}}")
#: Settings of a block: the terms of a variable, and a few more.
MOST_SETTINGS = MOST_TERMS + 20


def require_short_words(text: str) -> None:
    """Refuse a file with a word of more letters than any name has.

    Raises
    ------
    ControllerFileError
        With its line.
    """
    if word := _TOO_LONG.search(text):
        line = text.count("\n", 0, word.start()) + 1
        raise ControllerFileError(
            f"line {line}: {word[0][:40]!r}... has more than {LONGEST_NAME} letters; give a shorter name"
        )


_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")


def number(word: str, where: str) -> float:
    """Read a finite number.

    Raises
    ------
    ControllerFileError
        If it is not one.
    """
    value = float(word) if _NUMBER.fullmatch(word.strip()) else math.nan
    if not math.isfinite(value):
        raise ControllerFileError(
            f"{where}: {word.strip()[:40]!r} is not a finite number; write one, such as 0.5"
        )
    return value


def count(word: str, where: str, most: int) -> int:
    """Read a whole number from 1 to `most`."""
    if not re.fullmatch(r"\d{1,9}", word.strip()) or not 1 <= int(word) <= most:
        raise ControllerFileError(f"{where}: {word.strip()[:40]!r} is not a whole number from 1 to {most}")
    return int(word)


def choice(known: Mapping[str, _Choice], word: str, where: str, cure: str = "") -> _Choice:
    """Look up a word; refuse an unknown one with the nearest known.

    Parameters
    ----------
    known : mapping
        What there is a meaning for.
    word : str
        What the file says.
    where : str
        Where it says so, and of what.
    cure : str
        What to do about a word that a fuzzy system of ours cannot say.
    """
    if word not in known:
        raise ControllerFileError(
            f"{where} {word[:40]!r} cannot be read; {suggestion(word[:40], known)} {cure}".rstrip()
        )
    return known[word]


#: What a term is called, and its function.
Named = tuple[str, MembershipFunction]


def table(values: Sequence[float], where: str) -> model.Polyline:
    """Read ``x y x y …``."""
    if not values or len(values) % 2:
        raise ControllerFileError(
            f"{where}: {len(values)} numbers are not pairs of a point and a membership; give x y x y …"
        )
    x, y = tuple(values[::2]), tuple(values[1::2])
    if len(x) > MOST_POINTS:
        raise ControllerFileError(f"{where}: more than {MOST_POINTS} points; 101 are usual")
    if any(left >= right for left, right in pairwise(x)):
        raise ControllerFileError(f"{where}: the points do not ascend; sort them and drop repeated ones")
    if not all(0.0 <= value <= 1.0 for value in y):
        raise ControllerFileError(f"{where}: a membership lies outside [0, 1]; scale them")
    return model.Polyline(x, y)


#: Words of a format with the shapes they stand for and the order in which they state its numbers.
ShapeWords = Mapping[str, tuple[type[MembershipFunction], tuple[str, ...]]]
#: Words for a straight flank, or two: from their two numbers.
FlankWords = Mapping[str, Callable[[float, float], MembershipFunction]]


def rising(start: float, end: float) -> MembershipFunction:
    """Return zero up to `start`, one from `end` on."""
    return jump(start, 1.0) if start == end else model.Ramp(start, end)


def falling(start: float, end: float) -> MembershipFunction:
    """Return one up to `start`, zero from `end` on."""
    return jump(start, -1.0) if start == end else model.Ramp(end, start)


def ramp(start: float, end: float) -> MembershipFunction:
    """Return a ramp, which falls where its first number is the greater one; zero without a width."""
    return model.Polyline((start,), (0.0,)) if start == end else model.Ramp(start, end)


def step(start: float, towards: float) -> MembershipFunction:
    """Return one from `start` on in the direction of another number, zero on the other side."""
    return jump(start, 1.0 if towards > start else -1.0)


def jump(start: float, direction: float) -> model.Polyline:
    """Return one from `start` on in a direction, zero on the other side from the next number on."""
    next_value = float(np.nextafter(start, -direction * np.inf))
    return (
        model.Polyline((next_value, start), (0.0, 1.0))
        if direction > 0
        else model.Polyline((start, next_value), (1.0, 0.0))
    )


def level(start: float, end: float) -> MembershipFunction:
    """Return one between `start` and `end`, zero elsewhere."""
    start, end = sorted((start, end))
    return Trapezoidal(start, start, end, end)


#: The ends of a variable's range.
Extent = tuple[float, float]


def _words(text: str, _where: str) -> list[str]:
    return text.split()


@dataclass
class FileBlock:
    """A block of a file: its kind, its name and its settings, each with its line.

    Parameters
    ----------
    kind : str
        What opens it.
    name : str
    line : int
        Where it begins.
    settings : dict of str to (int, str)
        What it sets, each with its line.
    listed : list of (int, str)
        What it lists, likewise.
    """

    kind: str
    name: str
    line: int
    settings: dict[str, tuple[int, str]] = field(default_factory=dict)
    listed: list[tuple[int, str]] = field(default_factory=list)

    def add(self, line: int, content: str) -> None:
        """Add to the list; refuse more than any system has, before the rest is read."""
        if len(self.listed) >= MOST_RULES:
            raise ControllerFileError(
                f"line {line}: the block lists more than {MOST_RULES} rules or terms; make it smaller"
            )
        self.listed.append((line, content))

    def set(self, line: int, key: str, value: str) -> None:
        """Store a setting; refuse more than any variable has, before the rest is read."""
        if len(self.settings) >= MOST_SETTINGS:
            raise ControllerFileError(f"line {line}: the block has more than {MOST_SETTINGS} terms")
        self.settings[key] = line, value

    def entry(self, key: str, usual: str | None = None) -> tuple[str, str]:
        """Return a setting's location and text, or the default where it is missing."""
        if key not in self.settings and usual is None:
            called = f"{self.kind} {self.name}".strip()
            raise ControllerFileError(f"line {self.line}: {called} has no {key}; add it, or get a whole copy")
        line, value = self.settings.get(key, (self.line, usual or ""))
        return f"line {line}: the {key}", value.strip()

    def chosen(self, known: Mapping[str, _Choice], key: str, usual: str | None = None) -> _Choice:
        """Return the choice that a setting names."""
        where, word = self.entry(key, usual)
        return choice(known, word, where)

    def number(self, key: str, usual: str | None = None) -> float:
        """Return a setting's number."""
        where, word = self.entry(key, usual)
        return number(word, where)

    def extent(self, key: str, parted: Callable[[str, str], list[str]] = _words) -> Extent:
        """Return a setting's range; `parted` splits the text into two numbers."""
        where, words = self.entry(key)
        ends = [number(word, where) for word in parted(words, where)]
        if len(ends) != 2:
            raise ControllerFileError(f"{where} has {len(ends)} numbers; expected 2")
        return ends[0], ends[1]

    def expect(self, key: str, *allowed: str) -> None:
        """Refuse a setting other than the allowed ones."""
        where, word = self.entry(key, allowed[0])
        if word.lower() not in allowed:
            raise ControllerFileError(
                f"{where} of a {self.kind} is {word[:40]!r}, which cannot be read; expected "
                f"{' or '.join(allowed)}: change it or take the part out"
            )


def shape_numbers(words: Iterable[str], where: str) -> list[float]:
    """Read the numbers of a shape, of which some may be infinite."""
    return [
        math.copysign(math.inf, -1.0 if word[0] == "-" else 1.0)
        if word.strip().lower().lstrip("+-") == "inf"
        else number(word, where)
        for word in words
    ]


def shape(
    word: str, values: Sequence[float], shapes: ShapeWords, flanks: FlankWords, where: str
) -> MembershipFunction:
    """Return the membership function of a word and its numbers."""
    known = {**dict.fromkeys(shapes), **dict.fromkeys(flanks)}
    choice(known, word, f"{where}: the membership function", "or sample it as a table of points")
    order = shapes[word][1] if word in shapes else ("start", "end")
    if not any(values[len(order) :]):  # older versions of MATLAB pad with zeros
        values = values[: len(order)]
    if len(values) != len(order):
        raise ControllerFileError(
            f"{where}: {word} has {len(values)} numbers; expected {len(order)}: {', '.join(order)}"
        )
    if not all(map(math.isfinite, values)):
        open_ended = _without_an_end(word, values)
        if open_ended is None:
            raise ControllerFileError(f"{where}: {word} has an infinite number; write a finite one")
        return open_ended
    if word in flanks:
        return flanks[word](values[0], values[1])
    build: Callable[..., MembershipFunction] = shapes[word][0]
    kinds = build.entry.kinds if (is_even := build in _EVEN) else {}
    named = zip(order, values, strict=True)
    return build(
        **{name: abs(x) if is_even and kinds[name] in {"width", "deviation"} else x for name, x in named}
    )


#: Shapes whose widths count without their signs.
_EVEN = (model.Gaussian, model.TwoSidedGaussian, model.GeneralizedBell, model.Spike)


def _without_an_end(word: str, values: Sequence[float]) -> MembershipFunction | None:
    """Return a shape with an infinite number, level to that side; None where there is no such shape."""
    match word, [*values]:
        case ("Triangle" | "trimf", [left, top, right]):
            corners = [left, top, top, right]
        case ("Trapezoid" | "trapmf", [left, left_top, right_top, right]):
            corners = [left, left_top, right_top, right]
        case ("Rectangle" | "rectmf", [start, end]):
            corners = [start, start, end, end]
        case ("Binary" | "binarymf", [start, towards]) if math.isfinite(start):
            return step(start, towards)
        case _:
            return None
    left, left_top, right_top, right = corners
    if (left, right) == (-math.inf, math.inf):
        return model.Polyline((0.0,), (1.0,))
    if left == -math.inf and math.isfinite(right_top) and math.isfinite(right):
        return falling(right_top, right)
    if right == math.inf and math.isfinite(left_top) and math.isfinite(left):
        return rising(left, left_top)
    return None


@dataclass(frozen=True)
class TermWords:
    """The words of a format for the terms of a variable.

    Parameters
    ----------
    file_format : {"fis", "fll"}
        Whose words for shapes and numbers these are.
    flanks : mapping
        Words for straight flanks.
    weighed : str
        Which outputs have numbers for terms, in a sentence.
    """

    file_format: Format
    flanks: FlankWords
    weighed: str

    def read(
        self, word: str, values: Sequence[str], inputs: Sequence[str] | None, where: str
    ) -> MembershipFunction:
        """Read a term; `inputs`, their names, are those of an output that is weighed, else None."""
        shapes = words_of(self.file_format)
        is_formula = word.lower() == "function"
        is_number = is_formula or (word in shapes and issubclass(shapes[word][0], model.Number))
        if inputs is None and is_number:
            raise ControllerFileError(
                f"{where}: the term is a {word}, a number and no fuzzy set; only outputs by {self.weighed} "
                "have such terms"
            )
        if is_formula and inputs is not None:
            return concluded_formula(" ".join(values), inputs, where)
        numbers = shape_numbers(values, where)
        if inputs is not None:
            return concluded(word, numbers, len(inputs), self.file_format, where)
        if word == TABLES[self.file_format]:
            return table(numbers, where)
        return shape(word, numbers, shapes, self.flanks, where)


#: The words for a table of points.
TABLES: Mapping[Format, str] = {"fis": "discretemf", "fll": "Discrete", "fcl": ""}


def concluded(
    word: str, values: Sequence[float], num_inputs: int, file_format: Format, where: str
) -> MembershipFunction:
    """Return the weighted output's term of a word and its numbers: a number, or a monotone shape.

    A linear number may lack its constant; older versions of MATLAB pad with zeros.
    """
    shapes: ShapeWords = {**words_of(file_format), RAMPS[file_format]: (model.Ramp, ("start", "end"))}
    known = [w for w, (kind, _) in shapes.items() if issubclass(kind, model.Number | model.MonotoneFunction)]
    if word not in known:
        raise ControllerFileError(
            f"{where}: the output is a weighted average or sum, and its term is a {word[:40]!r}, which "
            f"cannot be weighed; use one of {', '.join(sorted(known))}"
        )
    if shapes[word][0] is not model.Linear:
        return shape(word, values, shapes, {}, where)
    *factors, constant = [*values, 0.0] if len(values) == num_inputs else values[: num_inputs + 1] or [0.0]
    if len(factors) != num_inputs or any(values[num_inputs + 1 :]) or not all(map(math.isfinite, values)):
        raise ControllerFileError(
            f"{where}: {word} has the numbers {', '.join(f'{x:g}' for x in values)}; expected "
            f"{num_inputs + 1} finite ones"
        )
    return model.Linear(tuple(factors), constant)


#: fuzzylite's words for terms.
FUZZYLITES = TermWords(
    "fll", {"Ramp": ramp, "Rectangle": level, "Binary": step}, "WeightedAverage and WeightedSum"
)

#: The word of a format for a ramp, which elsewhere is read as a trapezoid.
RAMPS: Mapping[Format, str] = {"fll": "Ramp", "fis": "rampmf", "fcl": "Ramp"}


def require_finished(what: str, parts: Mapping[str, Sized]) -> None:
    """Refuse a file that declares terms but no system, naming the parts that are empty."""
    missing = [name for name, listed in parts.items() if not len(listed)]
    if missing:
        raise ControllerFileError(f"{what} is unfinished: it has no {', no '.join(missing)}; add them")


def denied_conclusion(where: str, words: str, semantics: Semantics) -> str:
    """Return why a rule cannot conclude `not` or `any`."""
    fact = {
        "fcl": "jFuzzyLogic reads no such rule",
        "fuzzylite": "fuzzylite changes the rule's strength by it, unless that is zero, which jumps",
    }.get(semantics, "a number has no complement")
    return f"{where}: the rule concludes {words!r}, and {fact}; conclude a term made for it"


def kept_words(output: str) -> str:
    """Return the note on an output that keeps its last value where no rule fires."""
    return (
        f"{output} keeps its last value where no rule fires, here it takes its default: an evaluation here "
        'knows none before it; pass on_no_fire="hold" to carry values on from row to row'
    )


def concluded_formula(text: str, inputs: Sequence[str], where: str) -> MembershipFunction:
    """Read a formula of fuzzylite's; one that is linear in the inputs becomes a linear number."""
    formula = model.Formula(text)
    try:
        factors = linear(formula.parsed, inputs)
    except NotAFormula as error:
        raise ControllerFileError(
            f"{where}: {error}; it may have numbers, names, + - * / % ^ and {', '.join(FUNCTIONS)}"
        ) from error
    return formula if factors is None else model.Linear(tuple(map(float, factors[0])), float(factors[1]))


def variable(
    name: str, extent: Extent, terms: Sequence[Named], *, is_output: bool, num_points: int | None = None
) -> Variable:
    """Build a variable; an input's universe holds the corners of its terms."""
    low, high = extent
    named = tuple(Term(term, shape) for term, shape in terms)
    num_points = num_points or (OUTPUT_POINTS if is_output else INPUT_POINTS)
    bare = Variable(name, "", low, high, named, num_points)
    if is_output or not (low < high and np.isfinite(high - low)):  # a range without a width is refused later
        return bare
    return with_universe(bare, input_universe(low, high, [shape for _, shape in terms]))


def rule_words(rule: model.Rule) -> str:
    """Render a rule in fuzzylite's words; its consequents have one weight."""
    words, statement = before(rule.antecedent)
    if isinstance(statement, model.Is):
        words, statement = [], rule.antecedent
    known = {str(hedge): word for hedge, word in HEDGES.items()}
    hedges = "".join(f"{known[word]} " for word in words)
    concluded = " and ".join(f"{c.variable} is {hedges}{c.term}" for c in rule.consequents)
    weight = rule.consequents[0].weight
    return f"if {antecedent_words(statement, known)} then {concluded}" + (
        "" if weight == 1.0 else f" with {weight!r}"
    )
