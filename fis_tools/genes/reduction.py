"""Reduced genomes: short vectors that represent whole genomes, for searches that need few genes.

`Planes` describes each system by a gain for each input, which makes its rule table a plane, a width for
each variable's terms, and the output's reach; terms are evenly spaced. `KeptRules` keeps the rules and
tunes the rest.

`Stretches` keeps a controller readable: the range of every variable is stretched about zero with all its
terms, so that their shapes, order and overlap stay as drawn. For instance, terms that cross at one half and
are each one at their own peak only, stay so for all genes. Rule tables are planes or stay as they are.
"""

from dataclasses import dataclass, replace

import numpy as np

from fis_tools.array_types import Booleans, Floats
from fis_tools.engines.packing import Packed, pack
from fis_tools.errors import MissingExtra
from fis_tools.genes.parameters import SystemEncoding
from fis_tools.model import FuzzySystem, Term, Variable, rule_table, table_rules

#: a gain of one takes the output from one end to the other as its input goes from end to end
GREATEST_GAIN = 3.0


@dataclass(frozen=True)
class Planes:
    """Planar rule tables: for each system gains, widths and the reach, all in [0, 1].

    Parameters
    ----------
    encoding : SystemEncoding
        Of the whole genomes.
    """

    encoding: SystemEncoding

    @property
    def num_genes(self) -> int:
        """Length of the short vector."""
        return sum(2 * len(system.inputs) + 2 for system in self.encoding.systems)

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
        names = []
        for system in self.encoding.systems:
            inputs, output = [v.name for v in system.inputs], system.outputs[0].name
            names += [f"{system.name}.{name}.gain" for name in inputs]
            names += [f"{system.name}.{name}.width" for name in (*inputs, output)]
            names.append(f"{system.name}.{output}.reach")
        return names

    def expand(self, genes: Floats) -> Floats:
        """Return the genomes, shape (n, encoding.num_genes), of short ones of shape (n, k)."""
        genomes = np.full((len(genes), self.encoding.num_genes), 0.5)
        at = 0
        for system, places in zip(self.encoding.systems, self.encoding.places(), strict=True):
            count = len(system.inputs)
            gains = GREATEST_GAIN * (2.0 * genes[:, at : at + count] - 1.0)
            for place, widths in enumerate(places.widths):
                genomes[:, widths] = genes[:, [at + count + place]]
            genomes[:, places.reach] = genes[:, at + 2 * count + 1]
            num_terms = len(system.outputs[0].terms)
            genomes[:, places.rules] = (plane_terms(system, gains) + 0.5) / num_terms
            at += 2 * count + 2
        return genomes

    def reduce(self, genome: Floats) -> Floats:
        """Return the short vector of planes fitted to the tables of a genome, shape (encoding.num_genes,)."""
        genes: list[float] = []
        for system, places in zip(self.encoding.systems, self.encoding.places(), strict=True):
            num_terms = len(system.outputs[0].terms)
            terms = np.minimum(np.floor(num_terms * genome[places.rules]), num_terms - 1)
            genes += list(0.5 + 0.5 * plane_gains(system, terms) / GREATEST_GAIN)
            genes += [float(genome[widths].mean()) for widths in places.widths]
            genes.append(float(genome[places.reach]))
        return np.clip(np.array(genes, dtype=np.float64), 0.0, 1.0)


@dataclass(frozen=True)
class KeptRules:
    """Whole genomes without the genes of their rules, which are those of a given genome.

    Parameters
    ----------
    encoding : SystemEncoding
        Of the whole genomes.
    genome : (encoding.num_genes,) array
        Its rules are kept.
    """

    encoding: SystemEncoding
    genome: Floats

    @property
    def num_genes(self) -> int:
        """Length of the short vector."""
        return int(self._is_tuned().sum())

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
        return [
            name for name, tuned in zip(self.encoding.gene_names(), self._is_tuned(), strict=True) if tuned
        ]

    def expand(self, genes: Floats) -> Floats:
        """Return the genomes, shape (n, encoding.num_genes), of short ones of shape (n, k)."""
        genomes = np.repeat(self.genome[np.newaxis], len(genes), axis=0)
        genomes[:, self._is_tuned()] = genes
        return genomes

    def reduce(self, genome: Floats) -> Floats:
        """Return a genome without the genes of its rules."""
        return np.asarray(genome[self._is_tuned()])

    def _is_tuned(self) -> Booleans:
        is_tuned = np.ones(self.encoding.num_genes, dtype=np.bool_)
        for places in self.encoding.places():
            is_tuned[places.rules] = False
        return is_tuned


def plane_terms(system: FuzzySystem, gains: Floats) -> Floats:
    """Return the output term of each rule of planar tables with gains, shape (n, inputs), as (n, rules)."""
    last = len(system.outputs[0].terms) - 1
    return np.asarray(np.clip(np.rint(0.5 * last * (1.0 + gains @ _cells(system).T)), 0, last))


def plane_gains(system: FuzzySystem, terms: Floats) -> Floats:
    """Return the gains, shape (inputs,), that best fit the output terms of a table, shape (rules,).

    This works even if much of the plane is clipped at the ends.
    """
    try:
        from scipy.optimize import least_squares  # noqa: PLC0415 - large, and used only here
    except ModuleNotFoundError as error:
        raise MissingExtra("fitting planes to rule tables", "scipy", "scipy") from error

    cells, levels = _cells(system), 2.0 * terms / (len(system.outputs[0].terms) - 1) - 1.0

    def misfit(gains: Floats) -> Floats:
        return np.asarray(np.clip(cells @ gains, -1.0, 1.0) - levels)

    return np.asarray(least_squares(misfit, np.linalg.lstsq(cells, levels, rcond=None)[0]).x)


def _cells(system: FuzzySystem) -> Floats:
    """Return the position of each rule's terms in their ranges, from -1 to 1, shape (rules, inputs)."""
    axes = [np.linspace(-1.0, 1.0, len(variable.terms)) for variable in system.inputs]
    return np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=1)


#: with a larger gain, a step from one input term to the next would move the output by more than half its
#: range
READABLE_GAIN = 1.0
#: further digits of the terms' own numbers, which are fractions of the rounded range
MORE_DIGITS = 2


@dataclass(frozen=True)
class Stretches:
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
            if rule_table(system) is None:
                raise ValueError(f"system {system.name!r} is not a full rule table; only those can be tuned")
            for variable in (*system.inputs, *system.outputs):
                if variable.minimum != -variable.maximum or variable.points is not None:
                    raise ValueError(
                        f"variable {variable.name!r} ranges from {variable.minimum} to {variable.maximum}; "
                        "make it symmetric about zero and evenly spaced to stretch it"
                    )

    @property
    def num_genes(self) -> int:
        """Length of the vector."""
        return len(self.gene_names())

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
        names = []
        for system in self.systems:
            if self.has_planes:
                names += [f"{system.name}.{variable.name}.gain" for variable in system.inputs]
            names += [f"{system.name}.{v.name}.stretch" for v in (*system.inputs, *system.outputs)]
        return names

    def decode(self, genome: Floats) -> tuple[FuzzySystem, ...]:
        """Return the systems of one genome of shape (num_genes,)."""
        low, high = self.factors
        systems, at = [], 0
        for system in self.systems:
            count = len(system.inputs)
            table = rule_table(system)
            if self.has_planes:
                gains = READABLE_GAIN * (2.0 * genome[at : at + count] - 1.0)
                table = plane_terms(system, gains[np.newaxis])[0].astype(np.int64)
                at += count
            assert table is not None  # noqa: S101 - others are rejected above
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
        values = np.concatenate([one.values for one in packed])
        return replace(packed[0], values=values, rules=np.concatenate([one.rules for one in packed]))

    def encode(self, systems: tuple[FuzzySystem, ...]) -> Floats:
        """Return the genome, shape (num_genes,), of systems of this structure; clipped to the bounds."""
        low, high = self.factors
        genes: list[float] = []
        for own, system in zip(self.systems, systems, strict=True):
            table = rule_table(system)
            if table is None:
                raise ValueError(f"system {system.name!r} is not a full rule table; it has no genome")
            if self.has_planes:
                gains = plane_gains(system, table.astype(np.float64))
                genes += list(0.5 + 0.5 * gains / READABLE_GAIN)
            for before, now in zip(
                (*own.inputs, *own.outputs), (*system.inputs, *system.outputs), strict=True
            ):
                genes.append(float(np.log(now.maximum / before.maximum / low) / np.log(high / low)))
        return np.clip(np.array(genes, dtype=np.float64), 0.0, 1.0)

    def _stretched(self, variable: Variable, factor: float) -> Variable:
        """Return a variable with its range and all its terms stretched about zero."""
        reach = rounded(variable.maximum * factor, self.digits)
        factor = reach / variable.maximum
        terms = tuple(self._stretched_term(term, factor) for term in variable.terms)
        return replace(variable, minimum=-reach, maximum=reach, terms=terms)

    def _stretched_term(self, term: Term, factor: float) -> Term:
        shape = term.membership
        powers = {"place": 1, "width": 1, "deviation": 1, "slope": -1, "exponent": 0}
        digits = None if self.digits is None else self.digits + MORE_DIGITS
        numbers = {
            name: rounded(getattr(shape, name) * factor ** powers[kind], digits)
            for name, kind in shape.entry.kinds.items()
        }
        return Term(term.name, replace(shape, **numbers))


def rounded(value: float, digits: int | None) -> float:
    """Return a number rounded to significant digits; unchanged for None."""
    return float(value) if digits is None else float(f"{value:.{digits}g}")
