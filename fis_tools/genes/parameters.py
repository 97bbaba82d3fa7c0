"""A controller's tunable numbers as a flat vector of genes in [0, 1], and back.

For every variable, the means of the inner terms (the outer ones stay at the ends of the range) and all
standard deviations are tuned; for the output also the half-width of its symmetric range; and the output term
of every rule. Each inner mean moves inside its own window around its evenly spaced place, so that terms keep
their order and stay apart whatever the genes are.

Searches that need few genes have reduced genomes, short vectors that represent whole ones: `KeptRules` here,
`fis_tools.genes.planes` and `fis_tools.genes.stretches`.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fis_tools.array_types import Booleans, Floats, Integers
from fis_tools.engines import packing
from fis_tools.engines.packing import Packed
from fis_tools.model import FuzzySystem, Gaussian, Term, Variable, rule_table, table_cells, table_rules
from fis_tools.model.intervals import require_type_1
from fis_tools.model.shapes import gaussian
from fis_tools.model.systems import require_mamdani


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """The ranges that the genes span.

    Parameters
    ----------
    mean_window : float
        Width of the window of an inner mean, as a fraction of the spacing of evenly spaced terms; below 1, so
        that windows do not overlap.
    standard_deviation : (float, float)
        Least and greatest, as fractions of the range's width.
    output_reach : (float, float)
        Least and greatest end of a symmetric output range, in the output's unit; the gene is logarithmic.
    """

    mean_window: float = 0.9
    standard_deviation: tuple[float, float] = (0.04, 0.3)
    output_reach: tuple[float, float] = (0.01, 0.3)

    def __post_init__(self) -> None:
        """Raise ValueError for windows that overlap and bounds that are not ascending and positive."""
        if not 0 < self.mean_window < 1:
            raise ValueError(f"mean_window is {self.mean_window}; choose a fraction between 0 and 1")
        for name in ("standard_deviation", "output_reach"):
            low, high = getattr(self, name)
            if not 0 < low < high < np.inf:
                raise ValueError(
                    f"{name} is [{low}, {high}]; give a positive lower and a greater upper bound"
                )


@dataclass(frozen=True)
class GeneSlices:
    """Positions of one system's genes: for each variable, inputs first, the reach and the rules."""

    means: tuple[slice, ...]
    widths: tuple[slice, ...]
    reach: int
    rules: slice


#: Of a variable of n systems: its ends, (n,), and the means and standard deviations of its terms, (n, terms).
Numbers = tuple[Floats, Floats, Floats, Floats]


class Genes(ABC):
    """A genome's structure: what each gene tunes."""

    @abstractmethod
    def gene_names(self) -> list[str]:
        """Return the name of what each gene tunes."""

    @property
    def num_genes(self) -> int:
        """Length of the vector."""
        return len(self.gene_names())


@dataclass(frozen=True)
class SystemEncoding(Genes):
    """The mapping from genes to the systems of one controller.

    Genes run system by system; inside a system input by input (inner means, then standard deviations), then
    the output (inner means, standard deviations, reach), then the rules, the last input fastest.

    Parameters
    ----------
    systems : tuple of FuzzySystem
        The structure; `decode` replaces its tunable numbers.
    bounds : Bounds
    """

    systems: tuple[FuzzySystem, ...]
    bounds: Bounds

    def __post_init__(self) -> None:
        """Raise ValueError for systems that cannot be tuned in this way."""
        require_mamdani(self.systems, "tuning by these genes")
        require_type_1(self.systems, "tuning by these genes")
        for system in self.systems:
            full_table(system, "only those can be tuned")
            output = system.outputs[0]
            if output.minimum != -output.maximum:
                raise ValueError(
                    f"output {output.name!r} ranges from {output.minimum} to {output.maximum}; "
                    "make it symmetric about zero to tune its reach"
                )
            for variable in (*system.inputs, output):
                if fault := _fault(variable):
                    raise ValueError(f"variable {variable.name!r} {fault}")

    def gene_names(self) -> list[str]:
        """Return the name of what each gene tunes."""
        names = []
        for system in self.systems:
            for variable in system.variables:
                where = f"{system.name}.{variable.name}"
                names += [f"{where}.{term.name}.mean" for term in variable.terms[1:-1]]
                names += [f"{where}.{term.name}.standard_deviation" for term in variable.terms]
            names.append(f"{system.name}.{system.outputs[0].name}.reach")
            names += [f"{system.name}.rule_{index}" for index in range(len(system.rules))]
        return names

    def gene_slices(self) -> "list[GeneSlices]":
        """Return the positions of each system's genes."""
        slices, at = [], 0
        for system in self.systems:
            means, widths = [], []
            for variable in system.variables:
                terms = len(variable.terms)
                means.append(slice(at, at + terms - 2))
                widths.append(slice(at + terms - 2, at + 2 * terms - 2))
                at += 2 * terms - 2
            rules = slice(at + 1, at + 1 + len(system.rules))
            slices.append(GeneSlices(tuple(means), tuple(widths), at, rules))
            at = rules.stop
        return slices

    def decode(self, genome: Floats) -> tuple[FuzzySystem, ...]:
        """Return the systems of one genome of shape (num_genes,)."""
        genomes = self._checked(np.asarray(genome, dtype=np.float64)[np.newaxis])
        systems = []
        for system, slices in zip(self.systems, self.gene_slices(), strict=True):
            numbers_of = zip(system.variables, self._taken(genomes, system, slices), strict=True)
            *inputs, output = (self._decoded(variable, *numbers) for variable, numbers in numbers_of)
            words = [output.terms[index].name for index in chosen_terms(genomes[:, slices.rules], output)[0]]
            rules = table_rules(inputs, output, words)
            systems.append(replace(system, inputs=tuple(inputs), outputs=(output,), rules=rules))
        return tuple(systems)

    def pack(self, genomes: Floats) -> Packed:
        """Pack a population, shape (n, num_genes), as `engines.packing.pack` packs each decoded genome."""
        genomes = self._checked(np.asarray(genomes, dtype=np.float64))
        layout, num_values, num_entries = packing.layout_of(self.systems)
        values = np.zeros((len(genomes), num_values))
        rules = np.zeros((len(genomes), num_entries), dtype=np.int64)
        for row, system, slices in zip(layout, self.systems, self.gene_slices(), strict=True):
            *inputs, (low, high, means, widths) = self._taken(genomes, system, slices)
            for index, (variable, numbers) in enumerate(zip(system.inputs, inputs, strict=True)):
                sampled = _memberships(*numbers[:2], variable.num_points, *numbers[2:])
                packing.fill_input(values, row, index, *numbers[:2], sampled)
            output = system.outputs[0]
            sampled = _memberships(low, high, output.num_points, means, widths)
            default = np.full(len(genomes), 0.0 if output.default is None else output.default)
            packing.fill_output(values, rules, row, low, high, default, sampled)
            chosen = chosen_terms(genomes[:, slices.rules], output)
            packing.fill_rules(rules, row, table_cells(system.inputs), chosen)
        return Packed(layout, values, rules)

    def encode(self, systems: tuple[FuzzySystem, ...]) -> Floats:
        """Return the genome, shape (num_genes,), of systems of this structure; clipped to the bounds."""
        return np.clip(self.encode_unclipped(systems), 0.0, 1.0)

    def encode_unclipped(self, systems: tuple[FuzzySystem, ...]) -> Floats:
        """Return the genome as `encode` does, but outside [0, 1] where a number is beyond its bounds."""
        genes: list[float] = []
        for system in systems:
            for variable in system.variables:
                means, widths = _gaussians(variable)
                low, high = variable.minimum, variable.maximum
                centres, half_widths = self._windows(np.array([low]), np.array([high]), len(means))
                inner = (means - centres[0] + half_widths[0]) / (2 * half_widths[0])
                least, greatest = self.bounds.standard_deviation
                genes += list(inner[1:-1])
                genes += list((widths / (high - low) - least) / (greatest - least))
            shortest, longest = self.bounds.output_reach
            reach = system.outputs[0].maximum
            genes.append(float(np.log(reach / shortest) / np.log(longest / shortest)))
            table = full_table(system, "it has no genome")
            genes += list((table + 0.5) / len(system.outputs[0].terms))
        if len(genes) != self.num_genes:
            raise ValueError(
                f"the systems have {len(genes)} tunable numbers, this encoding has {self.num_genes}; "
                "encode systems of the same inputs and terms"
            )
        return np.array(genes, dtype=np.float64)

    def _checked(self, genomes: Floats) -> Floats:
        """Return genomes; raise ValueError unless they have the encoding's number of genes."""
        if genomes.ndim != 2 or genomes.shape[1] != self.num_genes:
            raise ValueError(
                f"genomes have shape {genomes.shape[-1:]} each, this encoding has {self.num_genes} genes; "
                "pass genomes of the same encoding"
            )
        return genomes

    def _taken(self, genomes: Floats, system: FuzzySystem, slices: GeneSlices) -> Iterator[Numbers]:
        """Yield the numbers of each variable of a system, inputs first."""
        for variable, inner, widths in zip(system.variables, slices.means, slices.widths, strict=True):
            low = np.full(len(genomes), variable.minimum)
            high = np.full(len(genomes), variable.maximum)
            if variable is system.outputs[0]:
                shortest, longest = self.bounds.output_reach
                high = shortest * (longest / shortest) ** genomes[:, slices.reach]
                low = -high
            means, half_widths = self._windows(low, high, len(variable.terms))
            means[:, 1:-1] += (2.0 * genomes[:, inner] - 1.0) * half_widths[:, np.newaxis]
            least, greatest = self.bounds.standard_deviation
            fractions = least + (greatest - least) * genomes[:, widths]
            yield low, high, means, fractions * (high - low)[:, np.newaxis]

    def _windows(self, low: Floats, high: Floats, terms: int) -> tuple[Floats, Floats]:
        """Return the centres, (n, terms), and half widths, (n,), of the windows in which means may lie."""
        centres = np.linspace(low, high, terms, axis=-1)
        return centres, 0.5 * self.bounds.mean_window * (high - low) / (terms - 1)

    @staticmethod
    def _decoded(variable: Variable, low: Floats, high: Floats, means: Floats, widths: Floats) -> Variable:
        """Return a variable with the decoded range, means and widths."""
        terms = tuple(
            Term(term.name, Gaussian(float(mean), float(width)))
            for term, mean, width in zip(variable.terms, means[0], widths[0], strict=True)
        )
        return replace(variable, minimum=float(low[0]), maximum=float(high[0]), terms=terms)


def chosen_terms(genes: Floats, output: Variable) -> Integers:
    """Return the output term of each rule by its gene, of the same shape."""
    chosen = np.floor(len(output.terms) * genes).astype(np.int64)
    return np.minimum(chosen, len(output.terms) - 1)


def full_table(system: FuzzySystem, why: str) -> Integers:
    """Return the consequents of a full rule table; a ValueError says why one is needed."""
    table = rule_table(system)
    if table is None:
        raise ValueError(f"system {system.name!r} is not a full rule table; {why}")
    return table


def _fault(variable: Variable) -> str:
    """Return why a variable cannot be tuned, or an empty string."""
    if len(variable.terms) < 2:
        return f"has {len(variable.terms)} term; give it two or more to tune it"
    if variable.points is not None:
        return "has a universe that is not evenly spaced; space it evenly to tune it"
    if not all(isinstance(term.membership, Gaussian) for term in variable.terms):
        return "has terms that are not Gaussian; use Gaussian"
    return ""


def _memberships(low: Floats, high: Floats, points: int, means: Floats, widths: Floats) -> Floats:
    """Return Gaussian memberships of n variables at the points of their universes, (n, terms, points)."""
    universe = np.linspace(low, high, points, axis=-1)
    return gaussian(universe[:, np.newaxis, :], means[:, :, np.newaxis], widths[:, :, np.newaxis])


def _gaussians(variable: Variable) -> tuple[Floats, Floats]:
    """Return the means and the standard deviations of a variable's terms, (terms,)."""
    shapes = [term.membership for term in variable.terms if isinstance(term.membership, Gaussian)]
    return np.array([s.mean for s in shapes]), np.array([s.standard_deviation for s in shapes])


@dataclass(frozen=True)
class KeptRules(Genes):
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

    def gene_names(self) -> list[str]:
        """Return the name of what each gene tunes."""
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
        """Return which genes stay: all but those of the rules, (encoding.num_genes,)."""
        is_tuned = np.ones(self.encoding.num_genes, dtype=np.bool_)
        for slices in self.encoding.gene_slices():
            is_tuned[slices.rules] = False
        return is_tuned
