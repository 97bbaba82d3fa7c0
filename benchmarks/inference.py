"""Microseconds per inference: scikit-fuzzy, similar programs, and ours, on the same systems and inputs."""

import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks import rivals
from benchmarks.rivals import Missing, Timed
from benchmarks.timing import best_cpu_seconds, best_wall_seconds
from fis_tools.engines.compiler import CompiledSystem, compile
from fis_tools.formats.exchange import fis
from fis_tools.model import (
    ALL_SEMANTICS,
    Constant,
    FuzzyController,
    FuzzySystem,
    Gaussian,
    Linear,
    Term,
    Variable,
    table_rules,
)
from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from tests.fis_tools.control_systems import build_simulation

Floats = NDArray[np.float64]

NUM_SAMPLES = 200_000
#: fewer samples for slow engines
NUM_RIVAL, NUM_ARRAY, NUM_STOCK, NUM_CALLED = 20_000, 500, 100, 20
#: other programs; the last two are called for each sample
RIVALS: dict[str, Callable[[FuzzySystem, Floats], Timed]] = {
    "fuzzylite, C++": rivals.fuzzylite,
    "pyfuzzylite, vectorised": rivals.pyfuzzylite,
    "fuzzytool, vectorised": partial(rivals.other_python, "fuzzytool-arrays"),
    "fuzzytool, one at a time": partial(rivals.other_python, "fuzzytool"),
    "simpful, one at a time": partial(rivals.other_python, "simpful"),
}
CALLED = ("fuzzytool, one at a time", "simpful, one at a time")

#: Engines sample at different points. With this many they agree to this share of the output's range:
#: scikit-fuzzy joins exact points by lines, fuzzylite uses the midpoints of slices.
FINE_POINTS, AGREEMENT = 1001, 2e-4
#: simpful sums over the points, with full weight for those at the ends
COARSE_AGREEMENT = 1e-3


def run(controller: str) -> None:
    """Print a row per engine: microseconds per inference and speed relative to scikit-fuzzy."""
    experiment = compose_experiment(["+experiment=evaluate", f"controller={controller}"]).experiment
    systems = (source.load(experiment.controller, experiment.mission).systems[0], _large_system())
    names = ", ".join(f"{system.name} ({len(system.rules)} rules)" for system in systems)
    print(f"Inference: {names}; random inputs over the universes")
    columns = []
    for system in systems:
        _check_agreement(system)
        columns.append(dict(_timed(system, _inputs(system, NUM_SAMPLES))))
    heads = [f"{len(system.rules)} rules, µs" for system in systems]
    print(f"  {'':<54}", *(f"{head:>16}{'times':>9}" for head in heads))
    for engine in columns[0]:
        cells = [_cell(column[engine], column["scikit-fuzzy compute()"]) for column in columns]
        print(f"  {engine:<54}", *cells, flush=True)


def run_weighed() -> None:
    """Print a table for Takagi-Sugeno: constants and linear functions of the inputs, 25 and 125 rules."""
    print("Takagi-Sugeno, weighted average, product; microseconds an inference, one thread")
    print(f"  {'':<24}{'pyfuzzylite':>14}{'compile':>10}{'times':>7}{'one at a time, on the clock':>30}")
    for num_inputs, is_linear in product((2, 3), (False, True)):
        system = _weighed(num_inputs, is_linear=is_linear)
        try:
            theirs, ours, single = _timed_weighed(system, _inputs(system, NUM_SAMPLES))
        except Missing as missing:
            print(f"  pyfuzzylite is left out: {missing}")
            return
        name = f"{len(system.rules)} rules, {'linear' if is_linear else 'constant'}"
        cells = f"{1e6 * theirs:>14,.3f}{1e6 * ours:>10,.3f}{theirs / ours:>7,.0f}{1e6 * single:>30,.2f}"
        print(f"  {name:<24}{cells}", flush=True)


def run_sampled(controller: str) -> None:
    """Print the times of programs that sum over points, and ours relative to scikit-fuzzy's kind.

    Ours are a call with one row, calls with 1,000 and with 100,000 rows on one thread, and `prepare()`.
    """
    experiment = compose_experiment(["+experiment=evaluate", f"controller={controller}"]).experiment
    programs: dict[str, tuple[str, Callable[[FuzzySystem, Floats], Timed]]] = {
        "scikit-fuzzy": ("scikit-fuzzy", _stock),
        "matlab": ("Octave", _octave),
        "fuzzylite": ("pyfuzzylite", rivals.pyfuzzylite),
    }
    for system in (source.load(experiment.controller, experiment.mission).systems[0], _large_system()):
        print(
            f"Sums over points, {len(system.rules)} rules, microseconds (and relative to scikit-fuzzy's kind)"
        )
        heads = "".join(f"{head:>18}" for head in ("one row", "1,000 rows", "100,000 rows", "prepare()"))
        print(f"  {'':<14}{'the program':>24}{heads}")
        kinds = {tool: compile(replace(system, semantics=tool), threads=1) for tool in ALL_SEMANTICS}
        times = _by_turns(kinds, _inputs(system, 100_000))
        for tool, seconds in times.items():
            name, theirs = "", None
            if tool in programs:
                name, program = programs[tool]
                theirs = _rival(program, kinds[tool].system, _inputs(system, NUM_STOCK))
            words = "left out" if theirs is None else f"{name} {1e6 * theirs:,.1f}"
            ratios = zip(seconds, times["scikit-fuzzy"], strict=True)
            cells = "".join(f"{1e6 * ours:>10,.3f} ({ours / plain:5.2f})" for ours, plain in ratios)
            print(f"  {tool:<14}{words:>24}{cells}", flush=True)


def _by_turns(kinds: Mapping[str, CompiledSystem], rows: Floats) -> dict[str, list[float]]:
    """Return the seconds per inference of compiled systems, in turn, as load changes."""
    best = {name: [math.inf] * 4 for name in kinds}
    prepared = {name: kind.prepare() for name, kind in kinds.items()}
    for _ in range(5):
        for name, kind in kinds.items():
            infer, row = prepared[name], rows[0].tolist()
            works: list[tuple[Callable[[], object], int]] = [
                (partial(_repeated, lambda kind=kind: kind(rows[:1]), 200), 200),
                (partial(_repeated, lambda kind=kind: kind(rows[:1000]), 10), 10_000),
                (partial(kind, rows), len(rows)),
                (partial(_repeated, lambda infer=infer, row=row: infer(*row), 1000), 1000),
            ]
            seconds = [best_cpu_seconds(work, repeats=1) / count for work, count in works]
            best[name] = list(map(min, best[name], seconds))
    return best


def _repeated(work: Callable[[], object], count: int) -> None:
    for _ in range(count):
        work()


def _octave(system: FuzzySystem, inputs: Floats) -> Timed:
    """Time `evalfis` of Octave's toolkit, inside of it."""
    octave = shutil.which("octave")
    if octave is None:
        raise Missing("apt-get install octave octave-fuzzy-logic-toolkit")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        written = fis.write(FuzzyController("timed", (system,)))
        (folder / "timed.fis").write_text(written.text, encoding="utf-8")
        np.savetxt(folder / "inputs", inputs)
        script = (
            "pkg load fuzzy-logic-toolkit\n"
            f"x = load ('{folder}/inputs'); f = readfis ('{folder}/timed.fis');\n"
            f"t = cputime; y = evalfis (x, f, 101); t = cputime - t;\n"
            f"dlmwrite ('{folder}/outputs', [t; y], 'precision', '%.17g');\n"
        )
        (folder / "run.m").write_text(script, encoding="utf-8")
        command = [octave, "--no-gui", "--quiet", "--no-init-file", str(folder / "run.m")]
        subprocess.run(command, check=True, capture_output=True)  # noqa: S603
        seconds, *outputs = np.loadtxt(folder / "outputs")
    return Timed(np.array(outputs), seconds / len(inputs))


def _timed_weighed(system: FuzzySystem, inputs: Floats) -> tuple[float, float, float]:
    """Return the seconds per inference of pyfuzzylite, of ours, and of ours one at a time."""
    compiled = compile(system, threads=1)
    rival = rivals.pyfuzzylite(system, inputs[:NUM_RIVAL])
    difference = np.abs(compiled(inputs[:NUM_RIVAL])[:, 0] - rival.outputs).max()
    assert difference < AGREEMENT, f"pyfuzzylite is off by {difference:.1e}"
    infer, row = compiled.prepare(), inputs[0].tolist()
    single = best_wall_seconds(lambda: [infer(*row) for _ in range(1000)], 20) / 1000
    return rival.seconds, best_cpu_seconds(lambda: compiled(inputs)) / len(inputs), single


def _weighed(num_inputs: int, *, is_linear: bool) -> FuzzySystem:
    """Return a full rule table over inputs of five Gaussian terms, cycling through five numbers."""
    terms = tuple(Term(f"t{index}", Gaussian(index / 2.0 - 1.0, 0.25)) for index in range(5))
    inputs = tuple(Variable(name, "", -1.0, 1.0, terms, FINE_POINTS) for name in ("x", "y", "z")[:num_inputs])
    numbers = [index / 4.0 - 0.5 for index in range(5)]
    shapes = [Linear((0.1 * x,) * num_inputs, x) if is_linear else Constant(x) for x in numbers]
    concluded = tuple(Term(f"u{index}", shape) for index, shape in enumerate(shapes))
    output = Variable("u", "", -1.0, 1.0, concluded, default=0.0, aggregation="unbounded_sum")
    cells = [f"u{sum(cell) % 5}" for cell in product(range(5), repeat=num_inputs)]
    rules = table_rules(inputs, output, cells)
    return FuzzySystem("weighed", inputs, (output,), rules, "product", defuzzifier="weighted_average")


def _cell(seconds: float | None, stock: float | None) -> str:
    if seconds is None or stock is None:
        return f"{'left out':>25}"
    return f"{1e6 * seconds:>16,.3f}{stock / seconds:>9,.0f}"


def _large_system() -> FuzzySystem:
    """125 rules, three inputs of five Gaussian terms each, consequents by the sum of the term numbers."""

    def variable(name: str) -> Variable:
        terms = tuple(Term(f"t{index}", Gaussian(index / 2.0 - 1.0, 0.25)) for index in range(5))
        return Variable(name, "", -1.0, 1.0, terms)

    inputs = tuple(variable(name) for name in ("x", "y", "z"))
    output = replace(variable("u"), default=0.0)
    consequents = [f"t{(a + b + c) // 3}" for a in range(5) for b in range(5) for c in range(5)]
    return FuzzySystem("three inputs", inputs, (output,), table_rules(inputs, output, consequents))


def _inputs(system: FuzzySystem, count: int) -> Floats:
    low = np.array([variable.minimum for variable in system.inputs])
    high = np.array([variable.maximum for variable in system.inputs])
    return np.random.default_rng(0).uniform(low, high, (count, len(low)))


def _with_points(system: FuzzySystem, num_points: int) -> FuzzySystem:
    return replace(
        system,
        inputs=tuple(replace(variable, num_points=num_points) for variable in system.inputs),
        outputs=tuple(replace(variable, num_points=num_points) for variable in system.outputs),
    )


def _check_agreement(system: FuzzySystem) -> None:
    """Fail unless all engines agree on fine universes, within the discretisation."""
    fine = _with_points(system, FINE_POINTS)
    inputs = _inputs(fine, NUM_ARRAY)
    expected = compile(fine)(inputs)[:, 0]
    width = fine.outputs[0].maximum - fine.outputs[0].minimum
    for name, engine in RIVALS.items():
        count = NUM_CALLED if name in CALLED else NUM_ARRAY
        try:
            difference = np.abs(engine(fine, inputs[:count]).outputs - expected[:count]).max() / width
        except Missing as missing:
            print(f"  {name} is left out: {missing}")
            continue
        allowed = COARSE_AGREEMENT if name.startswith("simpful") else AGREEMENT
        assert difference < allowed, f"{name} is off by {difference:.1e} of the range"
        print(f"  {system.name}: {name} agrees to {difference:.0e} of the range at {FINE_POINTS} points")
    stock = _stock(system, inputs[:10]).outputs
    assert np.abs(compile(system)(inputs[:10])[:, 0] - stock).max() < 1e-12 * width


def _timed(system: FuzzySystem, inputs: Floats) -> Iterator[tuple[str, float | None]]:
    """Yield each engine and its seconds per evaluation."""
    yield "scikit-fuzzy compute()", _stock(system, inputs[:NUM_STOCK]).seconds
    yield "scikit-fuzzy, arrays as inputs", _arrays(system, inputs[:NUM_ARRAY])
    for name, engine in RIVALS.items():
        yield name, _rival(engine, system, inputs[: NUM_CALLED if name in CALLED else NUM_RIVAL])
    prepared, row = compile(system).prepare(), inputs[0].tolist()
    single = best_wall_seconds(lambda: [prepared(*row) for _ in range(1000)], 20) / 1000
    yield "prepare(), any system, one at a time, on the clock", single
    for threads in (1, 2):
        compiled = compile(system, threads=threads)
        for kind, engine in (("any system", replace(compiled, packed=None)), ("by the kernel", compiled)):
            if threads == 1:
                seconds = best_cpu_seconds(lambda infer=engine: infer(inputs))
            else:
                seconds = best_wall_seconds(lambda infer=engine: infer(inputs), 20)
            is_other = engine.packed is None and kind == "by the kernel"
            words = "1 thread" if threads == 1 else f"{threads} threads, on the clock"
            yield f"compile(system), {kind}, {words}", None if is_other else seconds / len(inputs)


def _rival(
    engine: Callable[[FuzzySystem, Floats], Timed], system: FuzzySystem, inputs: Floats
) -> float | None:
    try:
        return engine(system, inputs).seconds
    except Missing:
        return None


def _stock(system: FuzzySystem, inputs: Floats) -> Timed:
    """Time compute(); each input once, as scikit-fuzzy caches inputs."""
    simulation = build_simulation(system)
    outputs = []
    started = time.process_time()
    for row in inputs:
        for variable, value in zip(system.inputs, row, strict=True):
            simulation.input[variable.name] = float(value)
        simulation.compute()
        outputs.append(simulation.output[system.outputs[0].name])
    return Timed(np.array(outputs), (time.process_time() - started) / len(inputs))


def _arrays(system: FuzzySystem, inputs: Floats) -> float:
    """Time compute() with arrays as inputs."""
    simulation = build_simulation(system)
    columns = inputs.T.copy()

    def infer() -> None:
        for variable, column in zip(system.inputs, columns, strict=True):
            simulation.input[variable.name] = column
        simulation.compute()

    return best_cpu_seconds(infer, repeats=3) / len(inputs)
