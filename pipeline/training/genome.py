"""What evolution tunes in a controller: its systems' numbers and rules, and its constants."""

from dataclasses import dataclass, replace

import numpy as np

from fis_tools.engines.packing import Packed
from fis_tools.genes.parameters import Bounds, KeptRules, SystemEncoding
from fis_tools.genes.planes import Planes
from fis_tools.genes.stretches import Stretches, rounded
from fis_tools.model import FuzzyController
from pipeline.array_types import Floats
from pipeline.flight.control.controller import Controller, ControllerError, from_fuzzy, has_constants
from pipeline.flight.state.signals import CONSTANTS, TOUR_COEFFICIENTS
from pipeline.settings.training import Encoding

#: genes beyond [0, 1] by less are rounding
ROUNDING = 1e-9


@dataclass(frozen=True)
class Genome:
    """The mapping from genes to a controller; every vector in [0, 1] is a controller.

    First come the genes of the systems (`fis_tools.genes.parameters`: all, or fewer), then one for each
    constant that is tuned, linear between its bounds, in the order of
    `pipeline.flight.state.signals.CONSTANTS`.

    Parameters
    ----------
    template : Controller
        Has the structure to tune, with an attribute for each tuned constant.
    systems : SystemEncoding or Stretches
    reduction : Planes or KeptRules, optional
        The genes of the systems, if they are fewer than the encoding's.
    constants : tuple of (str, float, float)
        Those tuned, with their bounds.
    digits : int, optional
        Significant digits to which numbers are rounded.
    """

    template: Controller
    systems: SystemEncoding | Stretches
    reduction: Planes | KeptRules | None
    constants: tuple[tuple[str, float, float], ...]
    digits: int | None = None

    @property
    def num_genes(self) -> int:
        """Length of the vector."""
        return self._num_system_genes + len(self.constants)

    @property
    def _num_system_genes(self) -> int:
        return (self.reduction or self.systems).num_genes

    def gene_names(self) -> list[str]:
        """Return for each gene what it tunes."""
        return (self.reduction or self.systems).gene_names() + [name for name, _, _ in self.constants]

    def pack(self, genomes: Floats) -> Packed:
        """Return a population of shape (n, num_genes) in the form that the compiled flight reads."""
        genomes = np.asarray(genomes, dtype=np.float64)
        numbers = self.systems.pack(self._system_genes(genomes))
        if not has_constants(self.template):
            return numbers
        rows = np.repeat(self.template.constants[np.newaxis], len(genomes), axis=0)
        order = list(CONSTANTS)
        for gene, (name, low, high) in enumerate(self.constants, start=self._num_system_genes):
            values = low + (high - low) * genomes[:, gene]
            rows[:, order.index(name)] = [rounded(value, self.digits) for value in values]
        return replace(numbers, values=np.hstack([numbers.values, rows]))

    def decode(self, genome: Floats) -> FuzzyController:
        """Return the controller of one genome of shape (num_genes,), under the template's name."""
        fuzzy = _fuzzy(self.template)
        attributes = dict(fuzzy.attributes)
        for gene, (name, low, high) in enumerate(self.constants, start=self._num_system_genes):
            attributes[name] = repr(rounded(low + (high - low) * genome[gene], self.digits))
        systems = self.systems.decode(self._system_genes(np.asarray(genome)[np.newaxis])[0])
        return replace(fuzzy, systems=systems, attributes=tuple(sorted(attributes.items())))

    def encode(self, controller: FuzzyController | None = None) -> Floats:
        """Return the genome of a controller of this structure, or of the template itself.

        Values outside the bounds are clipped; see `clipped`.
        """
        controller = controller or _fuzzy(self.template)
        genome = self.systems.encode(controller.systems)
        if self.reduction is not None:
            genome = self.reduction.reduce(genome)
        attributes = dict(controller.attributes)
        values = [float(attributes.get(name, "0")) for name, _, _ in self.constants]
        bounds = [(low, high) for _, low, high in self.constants]
        genes = [(value - low) / (high - low) for value, (low, high) in zip(values, bounds, strict=True)]
        return np.asarray(np.clip(np.concatenate([genome, np.array(genes)]), 0.0, 1.0))

    def clipped(self) -> list[str]:
        """Return in words which numbers of the template the bounds clip: constants with both values."""
        fuzzy = _fuzzy(self.template)
        genes = self.systems.encode_unclipped(fuzzy.systems)
        is_beyond = (genes < -ROUNDING) | (genes > 1.0 + ROUNDING)
        words = [name for name, beyond in zip(self.systems.gene_names(), is_beyond, strict=True) if beyond]
        for name, low, high in self.constants:
            value = float(dict(fuzzy.attributes)[name])
            if not low <= value <= high:
                words.append(f"{name} {value:g} to {min(max(value, low), high):g}")
        return words

    def expand(self, genomes: Floats) -> Floats:
        """Return genomes of the same controllers without a reduction, for some of shape (n, num_genes)."""
        return np.hstack([self._system_genes(genomes), genomes[:, self._num_system_genes :]])

    def _system_genes(self, genomes: Floats) -> Floats:
        """Return the genes of the systems at full length."""
        genes = genomes[:, : self._num_system_genes]
        return self.reduction.expand(genes) if self.reduction is not None else genes


def genome_of(template: Controller, settings: Encoding) -> Genome:
    """Return the genome that the settings define for a controller.

    Bounds that would clip a constant of the controller are replaced by others around it.

    Raises
    ------
    ControllerError, ValueError
        If the controller has no fuzzy system, or one that cannot be tuned like this.
    """
    fuzzy = _fuzzy(template)
    systems, reduction = _systems_of(fuzzy, settings)
    constants = []
    for name in (name for name, kind in CONSTANTS.items() if kind.is_tuned):
        # one without a setting for its bounds keeps its value
        pair: tuple[float, ...] | None = getattr(settings, bounds_key(name), None)
        if pair is not None and (name not in TOUR_COEFFICIENTS or name in dict(fuzzy.attributes)):
            value = float(dict(fuzzy.attributes).get(name, "0"))
            constants.append((name, *bounds_around(value, float(pair[0]), float(pair[1]))))
    if constants:
        attributes = {name: "0" for name, _, _ in constants} | dict(fuzzy.attributes)
        template = from_fuzzy(replace(fuzzy, attributes=tuple(sorted(attributes.items()))))
    return Genome(template, systems, reduction, tuple(constants), settings.digits)


def bounds_around(value: float, low: float, high: float) -> tuple[float, float]:
    """Return bounds widened to contain a value from a third to three times it, or to 1.5 times either sign.

    Bounds that contain the value already, or that are met by a constant that is 0 or new, stay.
    """
    if value == 0.0 or low <= value <= high:
        return low, high
    if low < 0.0:
        return min(low, -1.5 * abs(value)), max(high, 1.5 * abs(value))
    return min(low, value / 3.0), max(high, 3.0 * value)


def bounds_key(name: str) -> str:
    """Return the key of `Encoding` that has the bounds of a constant, which some share."""
    if name in TOUR_COEFFICIENTS:
        return "tour_m"
    return "dead_band_n" if name.startswith("dead_band") else name


def _systems_of(
    fuzzy: FuzzyController, settings: Encoding
) -> tuple[SystemEncoding | Stretches, Planes | KeptRules | None]:
    """Return the encoding of the systems, and its reduction if the genes are fewer."""
    if settings.stretch is not None:
        least, greatest = settings.stretch
        factors, has_planes = (least, greatest), settings.rules == "planes"
        return Stretches(fuzzy.systems, factors, has_planes, settings.digits), None
    least, greatest = settings.standard_deviation_fraction
    shortest, longest = settings.output_range_n
    bounds = Bounds(
        mean_window=settings.mean_window,
        standard_deviation=(least, greatest),
        output_reach=(shortest, longest),
    )
    try:
        systems = SystemEncoding(fuzzy.systems, bounds)
    except ValueError as error:
        raise ControllerError(
            f"{error}, or +experiment=train_readable_late, which stretches terms of any shape"
        ) from error
    if settings.rules == "planes":
        return systems, Planes(systems)
    if settings.rules == "fixed":
        return systems, KeptRules(systems, systems.encode(fuzzy.systems))
    return systems, None


def _fuzzy(controller: Controller) -> FuzzyController:
    """Return the fuzzy controller to train; raise ControllerError for a controller without one."""
    if controller.fuzzy is None:
        raise ControllerError(
            f"controller {controller.name!r} has no fuzzy system to train; choose a fuzzy one"
        )
    return controller.fuzzy
