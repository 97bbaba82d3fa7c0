"""Findings on variables: gaps between terms, overlaps, their order, and whether their names fit."""

import re
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fis_tools.analysis.arrays import MOST_PAIRED, crossings, distinguishability
from fis_tools.analysis.measures import Measures, centre
from fis_tools.findings.audit.report import Finding, Findings, Severity, Thresholds
from fis_tools.model import FuzzySystem, Variable, memberships_at, used_terms
from fis_tools.words.text import amount, listed, number, percent

#: Words of a magnitude, from little to much.
_MAGNITUDES = {
    "small": 1.0, "s": 1.0, "little": 1.0, "slight": 1.0, "slightly": 1.0,
    "medium": 2.0, "m": 2.0, "moderate": 2.0, "mid": 2.0,
    "large": 3.0, "l": 3.0, "big": 3.0, "b": 3.0, "great": 3.0, "strong": 3.0,
}  # fmt: skip
_SIGNS = {"negative": -1, "neg": -1, "n": -1, "minus": -1, "positive": 1, "pos": 1, "p": 1, "plus": 1}
_ZEROS = {"zero", "ze", "z", "zr", "zo", "null", "nil"}
#: Scales of words from low to high. A word in several is read by its neighbours.
_SCALES = [
    scale.split()
    for scale in (
        "low medium high", "low middle high", "low moderate high", "small medium large", "small medium big",
        "little medium much", "few some many", "near middle far", "near medium far", "close medium far",
        "slow medium fast", "short medium long", "short medium tall", "cold cool mild warm hot",
        "cold comfortable hot", "weak medium strong", "light medium heavy", "poor average good excellent",
        "bad decent great", "poor mediocre amazing", "cheap average generous", "young middle old",
        "dry moist wet", "dark dim bright", "empty half full",
    )
]  # fmt: skip
_STRONGER = {"very", "extremely", "v"}
_WEAKER = {"rather", "fairly", "quite", "somewhat"}


@dataclass(frozen=True)
class NameRank:
    """The rank of a term by its name, among terms whose names are read the same way.

    Parameters
    ----------
    rank : float
        Higher is higher.
    sign : int or None
        -1, 0 or 1 where the name says on which side of zero the term lies.
    """

    rank: float
    sign: int | None = None


def read_names(names: list[str]) -> list[NameRank | None]:
    """Return the rank of each term by its name; None for a name without one, or with another kind of name.

    Names such as ``negative_large``, ``NL``, ``zero``, ``PositiveSmall`` are read first. Without two of them
    that differ, the scale that knows most of the names counts, ``very`` and its like moving a word outwards.
    """
    phrases = [_words(name) for name in names]
    signed = [_signed(words) for words in phrases]
    if len({reading.sign for reading in signed if reading is not None}) > 1:
        return signed
    by_scale = [[_on_scale(words, scale) for words in phrases] for scale in _SCALES]
    best = max(by_scale, key=lambda readings: sum(reading is not None for reading in readings))
    zeros = [reading if reading is not None and reading.sign == 0 else None for reading in signed]
    if sum(reading is not None for reading in best) < 2:
        return list(zeros)
    return [zero or reading for zero, reading in zip(zeros, best, strict=True)]


def _words(name: str) -> list[str]:
    """Split a name, such as ``PositiveSmall`` or ``very_near``, into words of small letters."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word.lower() for word in re.split(r"[\W_\d]+", parted) if word]


def _signed(words: list[str]) -> NameRank | None:
    """Return the rank and sign that words such as ``negative small`` or ``PB`` give a term."""
    if len(words) == 1 and words[0] in _ZEROS:
        return NameRank(0.0, 0)
    if len(words) == 1 and (match := re.fullmatch(r"([np])(v?)([smlb])", words[0])):
        words = [letter for letter in match.groups() if letter]
    signs = [_SIGNS[word] for word in words if word in _SIGNS]
    magnitudes = [_MAGNITUDES[word] for word in words if word in _MAGNITUDES]
    known = len(signs) + len(magnitudes) + sum(word in _STRONGER for word in words)
    if len(signs) != 1 or len(magnitudes) > 1 or known != len(words):
        return None
    magnitude = (magnitudes or [2.0])[0] + 0.5 * sum(word in _STRONGER for word in words)
    return NameRank(signs[0] * magnitude, signs[0])


def _on_scale(words: list[str], scale: list[str]) -> NameRank | None:
    """Place a name on a scale from -1 to 1; ``very`` goes beyond its word, ``rather`` stays short."""
    outwards = 1.0 + 0.5 * sum(word in _STRONGER for word in words) - 0.25 * sum(w in _WEAKER for w in words)
    rest = [word for word in words if word not in _STRONGER | _WEAKER]
    if len(rest) != 1 or rest[0] not in scale:
        return None
    return NameRank(outwards * (2.0 * scale.index(rest[0]) / (len(scale) - 1) - 1.0))


#: Terms of a variable whose pairs are looked at.
MOST_COMPARED = 300


def find(system: FuzzySystem, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield the findings on the variables of a system."""
    yield from _unused(system)
    yield from _weighed(system)
    for variable in system.variables:
        if variable in system.weighed:
            continue
        findings = _of_sets(system, variable, measures, thresholds)
        yield from (replace(finding, variable=variable.name) for finding in findings)


def _of_sets(system: FuzzySystem, variable: Variable, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield the findings on a variable whose terms are fuzzy sets, without its name."""
    yield from _low(system, variable)
    yield from _covered(system, variable, measures, thresholds)
    yield from _many(variable, thresholds)
    if len(variable.terms) > MOST_COMPARED:
        yield Finding(
            "terms-not-compared",
            Severity.NOTE,
            f"The {len(variable.terms)} terms of {variable.name} are not compared with one another, nor are "
            f"their names and order: up to {MOST_COMPARED} are.",
            "Use fewer terms, or look at a part of the rules.",
        )
        return
    yield from _alike(variable, thresholds)
    yield from _ordered(variable)
    readings = read_names([term.name for term in variable.terms])
    yield from _named(variable, readings)
    yield from _signs(variable, readings)
    yield from _zero(variable, readings, thresholds)


def _weighed(system: FuzzySystem) -> Findings:
    """Yield a note on each weighted output, whose terms are not looked at."""
    for output in system.weighed:
        yield Finding(
            "weighed-output",
            Severity.NOTE,
            f"{output.name} is a {system.defuzzifier_of(output).replace('_', ' ')}: how its terms cover the "
            "range, overlap and are ordered says nothing, and is not looked at.",
            f"Read the numbers of {output.name} one by one.",
            output.name,
        )


def _unused(system: FuzzySystem) -> Findings:
    """Yield variables and terms that no rule uses."""
    used = used_terms(system.rules)
    for variable in system.variables:
        idle = [term.name for term in variable.terms if (variable.name, term.name) not in used]
        is_input = variable in system.inputs
        if len(idle) == len(variable.terms):
            does = "no rule uses it, so it changes nothing" if is_input else "no rule concludes on it"
            yield Finding(
                "unused-variable",
                Severity.SERIOUS,
                f"{variable.name} is declared, but {does}.",
                f"Write rules that use {variable.name}, or remove it.",
                variable.name,
            )
        elif idle:
            does = "used by no rule" if is_input else "concluded by no rule"
            terms = f"{listed(idle, len(idle))} of {variable.name}"
            yield Finding(
                "unused-term",
                Severity.WARNING if is_input else Severity.NOTE,
                f"{terms} {'is' if len(idle) == 1 else 'are'} {does}.",
                "Drop the term, or write the rule that is missing.",
                variable.name,
                tuple(idle),
            )


def _low(system: FuzzySystem, variable: Variable) -> Findings:
    """Yield terms whose membership stays below one half."""
    is_sampled = system.is_sampled and variable in system.outputs
    points = system.points_of(variable) if is_sampled else variable.universe
    for index, term in enumerate(variable.terms):
        values = memberships_at(variable, term, points) if is_sampled else variable.memberships[index]
        if (highest := float(values.max())) < 0.5:
            yield Finding(
                "term-height",
                Severity.SERIOUS if highest == 0 else Severity.WARNING,
                f"No value of {variable.name} belongs to {term.name} with a degree above "
                f"{number(round(highest, 3))}: its peak lies outside the range or between the "
                f"{len(points)} points of the universe.",
                "Move the peak into the range, widen the term, or give the universe more points.",
                terms=(term.name,),
                evidence={"highest": float(highest)},
            )


def _covered(system: FuzzySystem, variable: Variable, measures: Measures, thresholds: Thresholds) -> Findings:
    """Yield a finding if a part of an input's range belongs to no term."""
    worst = measures.coverage[variable.name]
    if worst.least >= thresholds.coverage or variable in system.outputs:
        return
    least, fired = number(round(worst.least, 3)), measures.completeness.least
    stretches = _gaps(variable, worst.at, thresholds.coverage)
    words = [f"from {amount(variable, low)} to {amount(variable, high)}" for low, high in stretches]
    gaps = "a gap" if len(words) == 1 else f"{len(words)} gaps,"
    low, high = next((low, high) for low, high in stretches if low <= worst.at <= high)
    severity = Severity.WARNING if fired < thresholds.coverage else Severity.NOTE
    yield Finding(
        "coverage",
        Severity.SERIOUS if fired < thresholds.fired else severity,
        f"{variable.name} has {gaps} {listed(words, len(words))}: no term "
        f"reaches a membership of {thresholds.coverage:g} there, and at {amount(variable, worst.at)} the "
        f"best one reaches {least}.",
        f"Widen the terms on both sides until each value has a membership of {thresholds.coverage:g} in one.",
        evidence={"least": worst.least, "at": worst.at, "from": low, "to": high, "gaps": len(words)},
    )


def _gaps(variable: Variable, worst: float, level: float) -> list[tuple[float, float]]:
    """Return where no term reaches a membership, ascending: the ends of each stretch.

    The highest membership is linear between points of the universe and crossings of terms.
    """
    universe, functions = variable.universe, variable.memberships
    others = crossings(universe, functions) if len(functions) <= MOST_PAIRED else np.array([worst])
    x = np.union1d(universe, np.append(others, worst))
    top = np.max([np.interp(x, universe, function) for function in functions], axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], top < level, [False]]).astype(np.int8)))
    stretches = []
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        ends = [
            x[here] + (x[next_] - x[here]) * (level - top[here]) / (top[next_] - top[here])
            if 0 <= next_ < len(x)
            else x[here]
            for here, next_ in ((first, first - 1), (last, last + 1))
        ]
        stretches.append((float(ends[0]), float(ends[1])))
    return stretches


def _alike(variable: Variable, thresholds: Thresholds) -> Findings:
    """Yield pairs of terms that are nearly the same, inside one another, or overlap much."""
    likeness = distinguishability(variable)
    areas = np.asarray(np.trapezoid(variable.memberships, variable.universe))
    for a, b in combinations(range(len(variable.terms)), 2):
        similarity = float(likeness.similarity[a, b])
        possibility = float(likeness.possibility[a, b])
        shared = similarity * (areas[a] + areas[b]) / (1.0 + similarity)
        narrow, wide = (a, b) if areas[a] <= areas[b] else (b, a)
        inside = float(shared / areas[narrow]) if areas[narrow] > 0 else 0.0
        inner, outer = variable.terms[narrow].name, variable.terms[wide].name
        evidence = {"similarity": similarity, "possibility": possibility, "inside": inside}
        if similarity > thresholds.look_alike:
            kind, severity = "look-alike-terms", Severity.WARNING
            sentence = f"{inner} and {outer} of {variable.name} mean nearly the same: they share "
            sentence += f"{percent(similarity)} of their areas."
            cure = "Merge the two terms, or move them apart."
        elif inside > thresholds.inside:
            kind, severity = "term-inside-another", Severity.NOTE
            sentence = f"{percent(inside)} of {inner} of {variable.name} lies under {outer}: "
            sentence += f"hardly any value is {inner} without being {outer} to the same degree."
            cure = f"Narrow {outer}, or check that its rules should act together with those of {inner}."
        elif possibility > thresholds.possibility:
            kind, severity = "overlapping-terms", Severity.NOTE
            sentence = (
                f"{inner} and {outer} of {variable.name} overlap with a membership of {possibility:.2f}: "
            )
            sentence += "they are hard to tell apart."
            cure = "Move the two terms apart, or narrow them."
        else:
            continue
        names_of_both = (variable.terms[a].name, variable.terms[b].name)
        yield Finding(kind, severity, sentence, cure, terms=names_of_both, evidence=evidence)


def _ordered(variable: Variable) -> Findings:
    """Yield neighbouring terms that are not listed from the lowest to the highest."""
    centres = [centre(variable, term) for term in variable.terms]
    for index in range(len(centres) - 1):
        if centres[index] > centres[index + 1]:
            before, after = variable.terms[index].name, variable.terms[index + 1].name
            yield Finding(
                "term-order",
                Severity.WARNING,
                f"{before} of {variable.name} is listed before {after}, but lies higher "
                f"({amount(variable, centres[index])} against {amount(variable, centres[index + 1])}).",
                "List terms from the lowest to the highest: tables and neighbours are read in this order.",
                terms=(before, after),
                evidence={"centres": centres},
            )


def _named(variable: Variable, readings: list[NameRank | None]) -> Findings:
    """Yield pairs of terms whose names say one order and whose membership functions another."""
    read = [
        (r, t, centre(variable, t)) for r, t in zip(readings, variable.terms, strict=True) if r is not None
    ]
    pairs = [
        (low, high)
        for low, high in combinations(sorted(read, key=lambda entry: entry[0].rank), 2)
        # zero lies below small and large, but between low and high
        if (low[0].sign is None) == (high[0].sign is None)
    ]
    wrong = [(low, high) for low, high in pairs if low[0].rank < high[0].rank and low[2] > high[2]]
    falling = len(pairs) > 1 and len(wrong) == len(pairs)
    for (_, low, low_at), (_, high, high_at) in wrong[:1] if falling else wrong:
        yield Finding(
            "name-order",
            Severity.WARNING if falling else Severity.SERIOUS,
            f"{low.name} of {variable.name} lies at {amount(variable, low_at)}, above {high.name} at "
            f"{amount(variable, high_at)}"
            + ("; all its terms are named from high to low." if falling else "."),
            "Swap the names or the membership functions: every rule that uses them reads wrongly.",
            terms=(low.name, high.name),
            evidence={"centres": [low_at, high_at]},
        )


def _signs(variable: Variable, readings: list[NameRank | None]) -> Findings:
    """Yield terms that lie on the other side of zero than their names say."""
    for reading, term in zip(readings, variable.terms, strict=True):
        x = centre(variable, term)
        if reading is not None and reading.sign and reading.sign * x < 0:
            yield Finding(
                "name-sign",
                Severity.SERIOUS,
                f"{term.name} of {variable.name} peaks at {amount(variable, x)}, on the other side of 0.",
                "Rename the term, or move it to the side that its name implies.",
                terms=(term.name,),
                evidence={"centre": x},
            )


def _zero(variable: Variable, readings: list[NameRank | None], thresholds: Thresholds) -> Findings:
    """Yield terms named like zero to which zero hardly belongs."""
    if not variable.minimum <= 0.0 <= variable.maximum:
        return
    at_zero = [float(np.interp(0.0, variable.universe, function)) for function in variable.memberships]
    for index, (reading, term) in enumerate(zip(readings, variable.terms, strict=True)):
        if reading is None or reading.sign != 0 or at_zero[index] >= thresholds.zero:
            continue
        position, best = centre(variable, term), int(np.argmax(at_zero))
        instead = f", but {at_zero[best]:.2f} in {variable.terms[best].name}" if best != index else ""
        yield Finding(
            "zero-off-zero",
            Severity.SERIOUS if best != index and at_zero[index] < 0.5 else Severity.WARNING,
            f"{term.name} of {variable.name} peaks at {amount(variable, position)}, "
            f"{percent(abs(position) / variable.span)} of the range away from 0: 0 has a membership "
            f"of only {at_zero[index]:.2f} in it{instead}.",
            f"Move {term.name} to 0, or rename it after where it lies.",
            terms=(term.name,),
            evidence={"centre": position, "membership_of_zero": at_zero[index]},
        )


def _many(variable: Variable, thresholds: Thresholds) -> Findings:
    """Yield a note on a variable with more terms than people tell apart."""
    if len(variable.terms) > thresholds.terms:
        yield Finding(
            "many-terms",
            Severity.NOTE,
            f"{variable.name} has {len(variable.terms)} terms; people tell about {thresholds.terms} apart.",
            "Merge terms that act alike (fis_tools simplify proposes some).",
            evidence={"terms": len(variable.terms)},
        )
