"""Findings along logs or other samples: rules that never fire, dominate or do nothing; clipped inputs."""

from collections.abc import Iterator

import numpy as np

from fis_tools.analysis.arrays import firing, rule_usage
from fis_tools.analysis.contribution import importance
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile as compiled
from fis_tools.findings.audit.report import Finding, Severity, Thresholds
from fis_tools.model import FuzzySystem
from fis_tools.words.text import amount, antecedent_words, consequent_words, listed, percent

#: The most samples over which the importance of rules is averaged; they are picked evenly.
MOST_SAMPLES = 2_000


def find(system: FuzzySystem, samples: Floats, thresholds: Thresholds) -> Iterator[Finding]:
    """Yield the findings on a system at the inputs that it was given, shape (n, num_inputs)."""
    yield from _clipped(system, samples, thresholds)
    strengths = firing(system, samples)
    usage = rule_usage(strengths, thresholds.fired)
    yield from _silent(system, strengths)
    yield from _dead(system, usage.fired, len(samples), thresholds)
    step = max(1, -(-len(samples) // MOST_SAMPLES))
    matters = importance(compiled(system), samples[::step]).max(axis=1)
    yield from _dominant(system, usage.leading, matters, thresholds)
    yield from _idle(system, usage.fired, matters, thresholds)


def _clipped(system: FuzzySystem, samples: Floats, thresholds: Thresholds) -> Iterator[Finding]:
    for variable, column in zip(system.inputs, samples.T, strict=True):
        outside = (column < variable.minimum) | (column > variable.maximum)
        if not outside.any():
            continue
        low, high = float(column.min()), float(column.max())
        beyond = [
            amount(variable, value)
            for value, is_beyond in ((low, low < variable.minimum), (high, high > variable.maximum))
            if is_beyond
        ]
        extent = f"{amount(variable, variable.minimum)} to {amount(variable, variable.maximum)}"
        part = float(outside.mean())
        yield Finding(
            "input-clipped",
            Severity.WARNING if part > thresholds.clipped else Severity.NOTE,
            system.name,
            f"{variable.name} was outside its range of {extent} in {percent(part)} of {len(column)} "
            f"inferences, up to {' and '.join(beyond)}: there the system saw only the end of its range.",
            "Widen the range to the values that occur, if the output should change there.",
            variable.name,
            evidence={"part": part, "low": low, "high": high},
        )


def _silent(system: FuzzySystem, strengths: Floats) -> Iterator[Finding]:
    part = float(np.mean(strengths.max(axis=1) == 0.0))
    if part > 0:
        yield Finding(
            "default-taken",
            Severity.SERIOUS,
            system.name,
            f"No rule fired in {percent(part)} of {len(strengths)} inferences: the defaults applied.",
            "Add rules for these inputs, or widen the terms.",
            evidence={"part": part, "first": int(np.argmax(strengths.max(axis=1) == 0.0))},
        )


def _dead(system: FuzzySystem, fired: Floats, num_samples: int, thresholds: Thresholds) -> Iterator[Finding]:
    dead = [int(index) + 1 for index in np.flatnonzero(fired == 0.0)]
    if not dead:
        return
    part = len(dead) / len(fired)
    yield Finding(
        "dead-rules",
        Severity.WARNING if part > thresholds.dead else Severity.NOTE,
        system.name,
        f"{len(dead)} of {len(fired)} rules never reached a firing strength of {thresholds.fired:g} in "
        f"{num_samples} inferences: {listed([str(number) for number in dead], 12)}.",
        "Log inputs that need them, or remove them; a rule that never fired is untested.",
        rules=tuple(dead),
        evidence={"part": part, "samples": num_samples},
    )


def _dominant(
    system: FuzzySystem, leading: Floats, matters: Floats, thresholds: Thresholds
) -> Iterator[Finding]:
    total = float(matters.sum())
    shares = matters / total if total > 0 else np.zeros(len(matters))
    for index, rule in enumerate(system.rules):
        lead, share = float(leading[index]), float(shares[index])
        if len(system.rules) < 3 or max(lead, share) <= thresholds.dominant:
            continue
        ways = (
            [f"fires most strongly in {percent(lead)} of the inferences"]
            if lead > thresholds.dominant
            else []
        )
        ways += (
            [f"makes up {percent(share)} of the effect of all rules"] if share > thresholds.dominant else []
        )
        yield Finding(
            "dominant-rule",
            Severity.NOTE,
            system.name,
            f"Rule {index + 1} (if {antecedent_words(rule.antecedent)} then "
            f"{consequent_words(rule.consequents)}) {' and '.join(ways)}.",
            "Split its terms where most inputs lie, or accept that this one rule decides.",
            rules=(index + 1,),
            evidence={"leading": lead, "share": share},
        )


def _idle(system: FuzzySystem, fired: Floats, matters: Floats, thresholds: Thresholds) -> Iterator[Finding]:
    idle = [int(i) + 1 for i in np.flatnonzero((fired > 0.0) & (matters < thresholds.idle))]
    if idle:
        yield Finding(
            "idle-rules",
            Severity.NOTE,
            system.name,
            f"{len(idle)} rule{'s' if len(idle) > 1 else ''} fired, but without "
            f"{'them' if len(idle) > 1 else 'it'} the outputs would differ by less than "
            f"{percent(thresholds.idle)} of their range on average: {listed([str(n) for n in idle], 12)}.",
            "Remove them (fis_tools simplify shows the largest change), or keep them for other inputs.",
            rules=tuple(idle),
            evidence={"importance": {str(number): float(matters[number - 1]) for number in idle}},
        )
