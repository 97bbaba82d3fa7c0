"""Fuzzy systems as functions of whole arrays: after ``compile(system)``, from arrays to arrays.

The results are those of the program that a system means (`fis_tools.model.semantics`). By default this is
scikit-fuzzy: its ``ControlSystemSimulation.compute()`` sample by sample, with three exceptions. NaN is an
error; in scikit-fuzzy it means "does not matter". If no rule fires an output has
its default; scikit-fuzzy then gives no output, a stale one, or, for the defuzzifiers of the maximum, some
point of the universe. Memberships below `fis_tools.model.variables.SMALLEST_MEMBERSHIP` are zero.
"""

from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, get_args, overload

import numpy as np
from numpy.typing import NDArray

from fis_tools.array_types import Booleans, Floats
from fis_tools.compiled.decorator import advise_numba
from fis_tools.engines import codes, interpreter, kernel, packing
from fis_tools.engines.inputs import as_rows, columns_of, pick
from fis_tools.engines.packing import NotCompilable, Packed
from fis_tools.engines.program import MANY_RULES, Conclusion, IntervalOutput, Program, Weighing, assemble
from fis_tools.engines.trees import CompiledTree
from fis_tools.model import FuzzyController, FuzzySystem, FuzzyTree, Inferable, whole
from fis_tools.model.validate import require_valid, validate
from fis_tools.processors import num_processors

#: Inputs that are identified by column names; see `fis_tools.engines.inputs.columns_of`.
TableLike = Any
OnNoFire = Literal["default", "nan", "hold", "raise"]
OnNan = Literal["raise", "nan"]

#: From this many samples on an additional thread pays.
SAMPLES_A_THREAD = 10_000

#: Limits of the kernel: the change of memberships from point to point, and the peak of each term.
STEEPEST = 0.25
LOWEST_PEAK = 0.5
#: The kernel measures positions from the middle of an output's range, scikit-fuzzy from zero. It is used
#: where both round alike to this share of the range; elsewhere only identical arithmetic gives the same
#: result.
ROUNDED = 1e-12
#: Error of scikit-fuzzy's sum over a universe of 101 points, in units in the last place; it may be larger.
UNITS_OFF = 16
#: The farthest number of an input, in steps between the points of its universe.
FARTHEST = 1500.0
#: Areas, in steps of the output's universe, below which hardly any digit is left: such samples are inferred
#: by identical arithmetic.
FAINTEST = 1e-3


#: the systems that were compiled last: several questions about one compile it once
_RECENT = deque["CompiledSystem"](maxlen=8)


class NoRuleFired(ValueError):  # noqa: N818 - the sentence is the message
    """Raised on request if no rule fires for an output."""


@dataclass(frozen=True)
class Answers:
    """Outputs, and a mask of those for which no rule fired.

    Parameters
    ----------
    outputs : (n, num_outputs) array, or dict of names to arrays
        In the form of the inputs.
    no_rule_fired : array or dict of bool
        In the same form: where no rule that concludes on the output fires.
    count : dict of str to int
        For each output, the number of samples in which none fires.
    """

    outputs: Any
    no_rule_fired: Any
    count: dict[str, int]


@dataclass(frozen=True, repr=False)
class CompiledSystem:
    """A fuzzy system that evaluates whole arrays; made by `compile`.

    Parameters
    ----------
    system : FuzzySystem
        The compiled system.
    program : Program
        The system as numbers.
    packed : Packed or None
        The same for `fis_tools.engines.kernel`, if that supports the system: faster, equal to 1e-13 of the
        range.
    threads : int
        Worker threads for a large batch; their number does not affect results.
    """

    system: FuzzySystem
    program: Program
    packed: Packed | None
    threads: int

    @overload
    def __call__(
        self, inputs: Floats, *, on_no_fire: OnNoFire = "default", on_nan: OnNan = "raise"
    ) -> Floats: ...
    @overload
    def __call__(
        self, inputs: TableLike, *, on_no_fire: OnNoFire = "default", on_nan: OnNan = "raise"
    ) -> dict[str, Floats]: ...
    def __call__(
        self, inputs: Any, *, on_no_fire: OnNoFire = "default", on_nan: OnNan = "raise"
    ) -> Floats | dict[str, Floats]:
        """Return the outputs for many samples.

        Parameters
        ----------
        inputs : (n, num_inputs) array, or mapping or table of names to arrays or numbers
            One row per sample, in the order of the system's inputs; or each input by its name, of shapes that
            broadcast. In a table (a data frame, a structured array) columns are found by name, in any
            order; other columns are ignored. Values out of range are clipped to the universes.
        on_no_fire : {"default", "nan", "hold", "raise"}
            The output where no rule that concludes on it fires: its default, NaN, the value of the
            row before (the default before the first row in which one fires), or an error.
        on_nan : {"raise", "nan"}
            Of a row in which an input is NaN: an error, or NaN for all of its outputs.

        Returns
        -------
        (n, num_outputs) array, or dict of names to arrays
            In the form of the inputs.

        Raises
        ------
        ValueError
            If the shape is wrong, an input is missing or unknown, or a value is NaN and `on_nan` is "raise".
        NoRuleFired
            If no rule fires and `on_no_fire` is "raise".
        """
        if on_no_fire != "default" or on_nan != "raise":
            return self.infer(inputs, on_no_fire=on_no_fire, on_nan=on_nan).outputs
        rows, shape = self._read(inputs)
        return self._by_name(self._infer(rows), shape)

    def infer(self, inputs: Any, *, on_no_fire: OnNoFire = "default", on_nan: OnNan = "raise") -> Answers:
        """Return the outputs, and where no rule fired; same parameters and errors as a call."""
        if on_no_fire not in get_args(OnNoFire):
            raise ValueError(f"on_no_fire is {on_no_fire!r}; use one of {', '.join(get_args(OnNoFire))}")
        if on_nan not in get_args(OnNan):
            raise ValueError(f"on_nan is {on_nan!r}; use one of {', '.join(get_args(OnNan))}")
        rows, shape = self._read(inputs, on_nan)
        is_missing: Booleans = np.asarray(np.isnan(rows).any(axis=1))
        if is_missing.any():
            return self._without(rows, is_missing, shape, on_no_fire)
        unfired = self._unfired(rows)
        if on_no_fire == "raise" and unfired.any():
            raise NoRuleFired(_where_unfired(self.system, rows, unfired))
        outputs = self._infer(rows)
        if on_no_fire == "nan":
            outputs[unfired] = np.nan
        if on_no_fire == "hold":
            last = np.maximum.accumulate(np.where(unfired, -1, np.arange(len(rows))[:, np.newaxis]), axis=0)
            outputs = np.where(last < 0, outputs, np.take_along_axis(outputs, last, axis=0))
        count = {v.name: int(n) for v, n in zip(self.system.outputs, unfired.sum(axis=0), strict=True)}
        return Answers(self._by_name(outputs, shape), self._by_name(unfired, shape), count)

    def _without(
        self, rows: Floats, is_missing: Booleans, shape: tuple[int, ...] | None, on_no_fire: OnNoFire
    ) -> Answers:
        """Return answers with NaN for rows in which an input is NaN."""
        known = self.infer(rows[~is_missing], on_no_fire=on_no_fire)
        outputs = np.full((len(rows), len(self.system.outputs)), np.nan)
        unfired = np.zeros(outputs.shape, dtype=np.bool_)
        outputs[~is_missing], unfired[~is_missing] = known.outputs, known.no_rule_fired
        return Answers(self._by_name(outputs, shape), self._by_name(unfired, shape), known.count)

    def _read(self, inputs: Any, on_nan: OnNan = "raise") -> tuple[Floats, tuple[int, ...] | None]:
        """Return inputs as rows, and the shape of their columns where they have names."""
        names = columns_of(inputs)
        if names is None:
            return self._rows(inputs, on_nan), None
        columns = pick(self.system, inputs, names)
        return self._rows(np.stack([column.ravel() for column in columns], axis=1), on_nan), columns[0].shape

    def _by_name(self, rows: NDArray[Any], shape: tuple[int, ...] | None) -> Any:
        """Return outputs as rows, or as columns of a shape by their names."""
        if shape is None:
            return rows
        columns = rows.T.reshape(-1, *shape)
        return {variable.name: column for variable, column in zip(self.system.outputs, columns, strict=True)}

    def _unfired(self, rows: Floats) -> Booleans:
        """Return where there is nothing to defuzzify: a centroid is a number if there is any area."""
        return np.isnan(self._shared(lambda part: interpreter.evaluate(self._marking, part), rows))

    @cached_property
    def _marking(self) -> Program:
        """The program, with centroids as defuzzifiers, NaN as defaults, and zero for formulas."""
        return replace(self.program, conclusions=tuple(map(_marked, self.program.conclusions)))

    def prepare(self) -> Callable[..., list[float]]:
        """Return a function for one sample at a time, some microseconds per call; for one thread.

        It takes the inputs as numbers in their order, and returns a list of the outputs. It raises a
        ValueError for a wrong number of inputs or NaN; infinite ones are clipped, as always.
        """
        return interpreter.prepare(self.program)

    def firing_strengths(self, inputs: Any) -> Floats:
        """Return each rule's firing strength, before weights: (n, num_rules), in the rules' order.

        Of interval type-2 systems (n, 2 num_rules): all lower strengths, then all upper ones.

        Same parameters and errors as a call; columns of a mapping or table must have one dimension.
        """
        return interpreter.fire(self.program, self._rows(inputs))

    def conclude(self, firing: Floats, inputs: Floats | None = None) -> Floats:
        """Return the outputs, (n, num_outputs), for given firing strengths, (n, num_rules).

        Parameters
        ----------
        firing : (n, num_rules)
        inputs : (n, num_inputs), optional
            Required if rules conclude numbers that depend on the inputs.

        Raises
        ------
        ValueError
            If the shape is wrong, a strength is NaN, or required inputs are missing.
        """
        strengths = np.ascontiguousarray(firing, dtype=np.float64)
        if strengths.ndim != 2 or strengths.shape[1] != self.program.num_rules:
            raise ValueError(
                f"firing strengths have shape {strengths.shape}; pass (n, {self.program.num_rules}), one for "
                "each rule"
            )
        if np.isnan(strengths).any():
            raise ValueError("a firing strength is NaN; pass numbers from 0 to 1")
        if inputs is not None:
            return interpreter.conclude(self.program, strengths, self._rows(inputs))
        return self._shared(lambda part: interpreter.conclude(self.program, part), strengths)

    def _infer(self, rows: Floats) -> Floats:
        return self._shared(self._infer_part, rows)

    def _infer_part(self, rows: Floats) -> Floats:
        if self.packed is None:
            return interpreter.evaluate(self.program, rows)
        outputs, areas = kernel.evaluate_with_areas(self.packed, rows)
        faint = np.flatnonzero(areas < FAINTEST)
        if len(faint):
            outputs[faint] = interpreter.evaluate(self.program, rows[faint])[:, 0]
        return outputs[:, np.newaxis]

    def _shared(self, work: Callable[[Floats], Floats], rows: Floats) -> Floats:
        """Apply a function to rows, in threads if there are very many."""
        threads = min(self.threads, len(rows) // SAMPLES_A_THREAD)
        if threads < 2:
            return work(rows)
        with ThreadPoolExecutor(threads) as pool:
            return np.concatenate(list(pool.map(work, np.array_split(rows, threads))))

    def _rows(self, inputs: Any, on_nan: OnNan = "raise") -> Floats:
        """Return inputs as rows, (n, num_inputs), with infinite ones clipped; raise ValueError for NaN."""
        rows = np.ascontiguousarray(as_rows(self.system, inputs))
        variables = self.system.inputs
        if rows.ndim != 2 or rows.shape[1] != len(variables):
            names = ", ".join(variable.name for variable in variables)
            raise ValueError(
                f"inputs have shape {rows.shape}; pass (n, {len(variables)}), a row a sample: {names}"
            )
        if np.isfinite(rows).all():
            return rows
        if on_nan == "raise" and np.isnan(rows).any():
            raise ValueError("an input is NaN; pass numbers, or on_nan='nan'")
        limits = self.program.limits
        return np.clip(rows, limits[:, 0], limits[:, 1])

    def __repr__(self) -> str:
        names = [", ".join(v.name for v in side) for side in (self.system.inputs, self.system.outputs)]
        return f"<compiled {self.system.name!r}: {self.program.num_rules} rules, {' -> '.join(names)}>"


@overload
def compile(system: FuzzySystem | CompiledSystem, *, threads: int | None = None) -> CompiledSystem: ...
@overload
def compile(system: FuzzyTree | CompiledTree, *, threads: int | None = None) -> CompiledTree: ...  # type: ignore[overload-overlap]
@overload
def compile(system: Inferable, *, threads: int | None = None) -> CompiledSystem | CompiledTree: ...  # type: ignore[overload-overlap]
@overload
def compile(
    system: object, *, defaults: Mapping[str, float] | None = None, threads: int | None = None
) -> CompiledSystem: ...
def compile(
    system: object, *, defaults: Mapping[str, float] | None = None, threads: int | None = None
) -> CompiledSystem | CompiledTree:
    """Compile a fuzzy system into a function of whole arrays.

    Parameters
    ----------
    system : FuzzySystem, FuzzyTree, or scikit-fuzzy's ControlSystem or ControlSystemSimulation
        The system to compile, or a controller of one or of wired ones. It is read once: later changes of a
        control system have no effect. A compiled system is returned as it is.
    defaults : mapping, optional
        For a control system: an output's value when no rule fires, by its name. Others get zero, or the end
        of their universe nearest to zero. A FuzzySystem declares its own.
    threads : int, optional
        Maximum number of threads that share a batch, with at least `SAMPLES_A_THREAD` samples each; by
        default one per processor.

    Raises
    ------
    fis_tools.model.validate.InvalidSystem
        If the system is invalid.
    fis_tools.scikit_fuzzy.read.UnreadableControlSystem
        If a control system contains something that cannot be compiled, or is not one; the text says what.
    ValueError
        If defaults are given for a FuzzySystem.
    """
    if isinstance(system, CompiledSystem | CompiledTree):
        return system
    if isinstance(system, FuzzyController):
        require_valid(system)
        system = whole(system, "compile one of them")
    threads = threads or num_processors()
    if isinstance(system, FuzzyTree):
        parts = tuple(compile(part, threads=threads) for part in system.systems)
        return CompiledTree(system, parts)
    for recent in tuple(_RECENT):
        if recent.system is system and recent.threads == threads and defaults is None:
            return recent
    if isinstance(system, FuzzySystem):
        if defaults is not None:
            raise ValueError("defaults are for control systems; declare them in the outputs of a FuzzySystem")
        validate(system)
        read = system
    else:
        from fis_tools.scikit_fuzzy.read import read_control_system  # noqa: PLC0415 - imports scikit-fuzzy

        read = read_control_system(system, defaults=defaults)
    if len(read.rules) >= MANY_RULES:
        advise_numba()
    compiled = CompiledSystem(read, assemble(read), _packed(read), threads)
    _RECENT.append(compiled)
    return compiled


def _marked(conclusion: Conclusion | Weighing | IntervalOutput) -> Conclusion | Weighing | IntervalOutput:
    """Return an output's program whose answer is NaN if and only if no rule fires."""
    if isinstance(conclusion, IntervalOutput):
        return conclusion._replace(upper=conclusion.upper._replace(default=np.nan))
    if isinstance(conclusion, Conclusion):
        return conclusion._replace(defuzzifier=codes.CENTROID, default=np.nan)
    is_formula = conclusion.kinds == codes.FORMULA
    return conclusion._replace(
        default=np.nan,
        kinds=np.where(is_formula, codes.NUMBER, conclusion.kinds),
        parameters=np.where(is_formula[:, np.newaxis], 0.0, conclusion.parameters),
        formulas=(),
        names=(),
    )


def _where_unfired(system: FuzzySystem, rows: Floats, unfired: Booleans) -> str:
    """Describe where no rule fires: how often, and at which sample first."""
    sample, column = np.argwhere(unfired)[0]
    values = ", ".join(f"{v.name} {x:.6g}" for v, x in zip(system.inputs, rows[sample], strict=True))
    return (
        f"no rule for {system.outputs[column].name!r} fires at {int(unfired[:, column].sum())} of "
        f"{len(rows)} samples, first at number {sample} ({values}); add rules, or take another on_no_fire"
    )


def _packed(system: FuzzySystem) -> Packed | None:
    """Pack a system for the kernel if its method keeps all digits: with smooth terms that reach their top.

    If terms are narrower than the grid, hardly any area is left and rounding dominates; then only
    identical arithmetic gives the same result.
    """
    if system.weighed or system.is_sampled:
        return None
    for memberships in (variable.memberships for variable in system.variables):
        if np.abs(np.diff(memberships)).max() > STEEPEST or memberships.max(axis=1).min() < LOWEST_PEAK:
            return None
    for output in system.outputs:
        farthest = max(abs(output.minimum), abs(output.maximum))
        units = UNITS_OFF * max(1.0, output.num_points / 101)
        if units * np.spacing(farthest) > ROUNDED * output.span:
            return None
    for variable in system.inputs:
        farthest = max(abs(variable.minimum), abs(variable.maximum))
        if farthest * (variable.num_points - 1) > FARTHEST * variable.span:
            return None
    try:
        return packing.pack(system)
    except NotCompilable:
        return None
