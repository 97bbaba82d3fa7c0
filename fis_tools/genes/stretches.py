"""Stretched ranges as genes, which keep a controller readable.

The range of every variable is stretched about zero with all its terms, so that their shapes, order and
overlap stay as drawn. For instance, terms that cross at one half, and are each one at their own peak only,
stay so for all genes. Rule tables are planes or stay as they are.
"""

from dataclasses import dataclass, replace

import numpy as np

from fis_tools.array_types import Floats
from fis_tools.engines.packing import Packed, pack
from fis_tools.genes.parameters import Genes, full_table
from fis_tools.genes.planes import plane_gains, plane_terms
from fis_tools.model import FuzzySystem, Term, Variable, table_rules

#: with a larger gain, a step from one input term to the next would move the output by more than half its
#: range
READABLE_GAIN = 1.0
#: further digits of the terms' own numbers, which are fractions of the rounded range
MORE_DIGITS = 2


@dataclass(frozen=True)
class Stretches(Genes):
    """The mapping from genes to stretches in the systems of one controller; all genes are in [0, 1].

    Genes run system by system: a gain for each input if tables are planes, then the stretch of each input
    and of the output.

    Parameters
    ----------
    systems : tuple of FuzzySystem
        Each a full rule table, with ranges symmetric about zero.
    factors : (float, float)
        The least and the greatest stretch; the gene is logarithmic.
    has_planes : bool
        Whether tables are planes; else they are kept.
    digits : int or None
        Significant digits to which ranges are rounded.
    """

    systems: tuple[FuzzySystem, ...]
    factors: tuple[float, float]
    has_planes: bool
    digits: int | None = None

    def __post_init__(self) -> None:
        """Raise ValueError for systems that cannot be tuned in this way."""
        for system in self.systems:
            full_table(system, "only those can be tuned")
            for variable in system.variables:
                if variable.minimum != -variable.maximum or variable.points is not None:
                    raise ValueError(
                        f"variable {variable.name!r} ranges from {variable.minimum} to {variable.maximum}; "
                        "make it symmetric about zero and evenly spaced to stretch it"
                    )

    def gene_names(self) -> list[str]:
        """Return the name of what each gene tunes."""
        names = []
        for system in self.systems:
            if self.has_planes:
                names += [f"{system.name}.{variable.name}.gain" for variable in system.inputs]
            names += [f"{system.name}.{v.name}.stretch" for v in system.variables]
        return names

    def decode(self, genome: Floats) -> tuple[FuzzySystem, ...]:
        """Return the systems of one genome of shape (num_genes,)."""
        low, high = self.factors
        systems, at = [], 0
        for system in self.systems:
            count = len(system.inputs)
            table = full_table(system, "only those can be tuned")
            if self.has_planes:
                gains = READABLE_GAIN * (2.0 * genome[at : at + count] - 1.0)
                table = plane_terms(system, gains[np.newaxis])[0]
                at += count
            factors = low * (high / low) ** genome[at : at + count + 1]
            at += count + 1
            inputs = tuple(self._stretched(v, f) for v, f in zip(system.inputs, factors, strict=False))
            output = self._stretched(system.outputs[0], factors[-1])
            words = [output.terms[index].name for index in table]
            rules = table_rules(inputs, output, words)
            systems.append(replace(system, inputs=inputs, outputs=(output,), rules=rules))
        return tuple(systems)

    def pack(self, genomes: Floats) -> Packed:
        """Pack a population, shape (n, num_genes), as `engines.packing.pack` packs each decoded genome."""
        packed = [pack(*self.decode(genome)) for genome in genomes]
        values = np.concatenate([packed_system.values for packed_system in packed])
        return replace(
            packed[0], values=values, rules=np.concatenate([packed_system.rules for packed_system in packed])
        )

    def encode(self, systems: tuple[FuzzySystem, ...]) -> Floats:
        """Return the genome, shape (num_genes,), of systems of this structure; clipped to the bounds."""
        return np.clip(self.encode_unclipped(systems), 0.0, 1.0)

    def encode_unclipped(self, systems: tuple[FuzzySystem, ...]) -> Floats:
        """Return the genome as `encode` does, but outside [0, 1] where a number is beyond its bounds."""
        low, high = self.factors
        genes: list[float] = []
        for reference, system in zip(self.systems, systems, strict=True):
            table = full_table(system, "it has no genome")
            if self.has_planes:
                gains = plane_gains(system, table)
                genes += list(0.5 + 0.5 * gains / READABLE_GAIN)
            for before, now in zip(reference.variables, system.variables, strict=True):
                genes.append(float(np.log(now.maximum / before.maximum / low) / np.log(high / low)))
        return np.array(genes, dtype=np.float64)

    def _stretched(self, variable: Variable, factor: float) -> Variable:
        """Return a variable with its range and all its terms stretched about zero."""
        reach = rounded(variable.maximum * factor, self.digits)
        factor = reach / variable.maximum
        terms = tuple(self._stretched_term(term, factor) for term in variable.terms)
        return replace(variable, minimum=-reach, maximum=reach, terms=terms)

    def _stretched_term(self, term: Term, factor: float) -> Term:
        """Return a term stretched about zero: places and widths by the factor, slopes by its inverse."""
        shape = term.membership
        powers = {"location": 1, "width": 1, "deviation": 1, "slope": -1, "exponent": 0}
        digits = None if self.digits is None else self.digits + MORE_DIGITS
        numbers = {
            name: rounded(getattr(shape, name) * factor ** powers[kind], digits)
            for name, kind in shape.entry.kinds.items()
        }
        return Term(term.name, replace(shape, **numbers))


def rounded(value: float, digits: int | None) -> float:
    """Return a number rounded to significant digits; unchanged for None."""
    return float(value) if digits is None else float(f"{value:.{digits}g}")
