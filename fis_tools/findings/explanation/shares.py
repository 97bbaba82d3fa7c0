"""The share of each rule in the effect of all rules over many samples, such as a flight."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fis_tools.analysis import shapley
from fis_tools.analysis.arrays import FIRED, rule_usage
from fis_tools.analysis.contribution import importance
from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.model import FuzzySystem
from fis_tools.words.text import amount, percent, sentence, with_unit
from plain_files.document import Block, Document, Heading, Paragraph, Result, Table, plain

#: Rules are told until they make this share of all movement, and no more than so many.
SHOWN_SHARE = 0.95
MOST_RULES = 12


@dataclass(frozen=True)
class RuleShare:
    """The effect of one rule over the samples.

    Parameters
    ----------
    rule : int
        Its number, from 1 as in every listing.
    share : float
        Of all that the rules moved: its part over the sum of all. Parts are measured against the output's
        range; of several outputs the one that the rule moves most counts.
    moved, needed : tuple of float
        How far it moved each output, in the outputs' units: the mean sizes of its shares, and of what would
        have been missing without it.
    fired, leading : float
        Fractions of the samples in which it fires at `fis_tools.analysis.arrays.FIRED` or more, and in which
        no rule fires stronger.
    strongest : float
        Its greatest firing strength.
    """

    rule: int
    share: float
    moved: tuple[float, ...]
    needed: tuple[float, ...]
    fired: float
    leading: float
    strongest: float


@dataclass(frozen=True, repr=False)
class FlightShares(Result):
    """The effects of the rules of a system over samples, the largest share first."""

    system: FuzzySystem
    num_samples: int
    rules: tuple[RuleShare, ...]

    def document(self, *, everything: bool = False) -> Document:
        """List the rules that decide; with `everything`, the others too."""
        shown = self._shown(everything)
        head, *rows = self._rows(shown)
        blocks: list[Block] = [Heading(self._summary()), Table(head, rows, numbers=range(len(head) - 1))]
        rest = [Paragraph(self._rest(shown))] if len(shown) < len(self.rules) else []
        return Document([*blocks, *rest])

    def plain(self) -> dict[str, Any]:
        """Return the shares as plain JSON data.

        Keys are ``system``, ``samples`` (how many) and ``rules``, the greatest share first: its number
        (``rule``), ``sentence``, and as in `RuleShare` ``share``, ``moved`` and ``needed`` (by the output's
        name), ``fired``, ``leading`` and ``strongest``.
        """
        outputs = [variable.name for variable in self.system.outputs]
        return {
            "system": self.system.name,
            "samples": self.num_samples,
            "rules": [
                {
                    **plain(rule),
                    "sentence": sentence(self.system.rules[rule.rule - 1]),
                    "moved": dict(zip(outputs, rule.moved, strict=True)),
                    "needed": dict(zip(outputs, rule.needed, strict=True)),
                }
                for rule in self.rules
            ],
        }

    def _shown(self, everything: bool) -> tuple[RuleShare, ...]:
        """Return the rules to list: those that make up most of the effect, or all."""
        if everything:
            return self.rules
        before = np.cumsum([0.0, *(rule.share for rule in self.rules[:-1])])
        count = int(np.count_nonzero(before < SHOWN_SHARE))
        moving = sum(rule.share > 0.0 for rule in self.rules)
        return self.rules[: max(1, min(count, moving, MOST_RULES))]

    def _summary(self) -> str:
        """Return in a sentence which rule contributes most, and how many never fire."""
        first = self.rules[0]
        silent = sum(rule.fired == 0.0 for rule in self.rules)
        part = f"{percent(first.share)} of all contributions"
        contributes = f"rule {first.rule} contributes most ({part})"
        contributes = contributes if first.share > 0.0 else "no rule moved anything"
        over = f"{self.num_samples} inference{'' if self.num_samples == 1 else 's'}"
        return (
            f"{self.system.name} over {over}: {contributes}; {silent} of {len(self.rules)} rules never fire "
            f"at {FIRED:g} or more"
        )

    def _rest(self, shown: tuple[RuleShare, ...]) -> str:
        """Return the share of the rules that are not listed, in words."""
        rest = max(0.0, 1.0 - sum(rule.share for rule in shown))
        others = len(self.rules) - len(shown)
        if rest < 1e-12 or not any(rule.share for rule in self.rules):
            return f"the other {others} moved nothing"
        return f"the other {others} make {percent(rest)}"

    def _rows(self, shown: tuple[RuleShare, ...]) -> list[list[str]]:
        """Return a heading and a row for each rule shown: shares, amounts moved, and the rule in words."""
        outputs = self.system.outputs
        names = [""] if len(outputs) == 1 else [f" {with_unit(variable)}" for variable in outputs]
        heads = [word + name for word in ("moved", "needed") for name in names]
        rows = [["share", *heads, "fired", "leading", "max", "rule"]]
        for rule in shown:
            values = zip((*outputs, *outputs), (*rule.moved, *rule.needed), strict=True)
            amounts = [amount(variable, value) for variable, value in values]
            parts = [f"{100 * part:.1f} %" for part in (rule.share, rule.fired, rule.leading)]
            words = f"{rule.rule}. {sentence(self.system.rules[rule.rule - 1])}"
            rows.append([parts[0], *amounts, *parts[1:], f"{rule.strongest:.2f}", words])
        return rows


def shares(system: object, samples: Floats) -> FlightShares:
    """Compute the share of each rule in the effect of all rules.

    Parameters
    ----------
    system : FuzzySystem, CompiledSystem, or what `fis_tools.engines.compiler.compile` takes
    samples : (n, num_inputs)
        One row per sample, at least one, such as a flight's (`fis_tools.analysis.flights.inputs_along`).

    Raises
    ------
    ValueError
        If there are no samples, or they do not fit the system.
    """
    compiled = compile(system)
    usage = rule_usage(compiled.firing_strengths(samples)[:, -len(compiled.system.rules) :])
    spans = np.array([variable.span for variable in compiled.system.outputs])
    weights = shapley.importance(compiled, samples)
    moved, needed = weights * spans, importance(compiled, samples) * spans
    weights = weights.max(axis=1)
    total = float(weights.sum())
    parts = weights / total if total > 0.0 else weights
    order = np.lexsort((-usage.fired, -parts))
    counted = np.column_stack([usage.fired, usage.leading, usage.max_strength])
    rules = []
    for index in order.tolist():
        far = (tuple(moved[index].tolist()), tuple(needed[index].tolist()))
        rules.append(RuleShare(index + 1, float(parts[index]), *far, *counted[index].tolist()))
    return FlightShares(compiled.system, len(samples), tuple(rules))
