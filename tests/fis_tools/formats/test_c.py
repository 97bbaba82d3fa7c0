"""The C that is written: compiled by gcc with every warning an error, it gives what Python gives."""

import ctypes
import io
import re
import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.formats.c import fmu, source
from fis_tools.formats.serialize import load
from fis_tools.model import And, Consequent, FuzzyController, FuzzySystem, Is, Rule, Term, Variable, shapes
from fis_tools.model.operators import AGGREGATIONS, AND_OPERATORS
from fis_tools.model.validate import controller_problems
from fis_tools.source import read_controller
from fis_tools.words.text import sentence
from tests.fis_tools import step_by_step
from tests.fis_tools.engines import random_systems, weighed_systems
from tests.fis_tools.engines.random_systems import full_table_system, inputs_for, random_general_system
from tests.fis_tools.sample_controllers import FORCE_X, GENERAL, PAPER_LIKE, SHIPPED, TIPPER
from tests.programs import program


def run_in(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a program in a folder."""
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603


def gcc(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return run_in(folder, program("gcc", "gcc"), *source.FLAGS.split(), "-O2", *words)


def loaded(path: Path, text: str, *words: str) -> ctypes.CDLL:
    """Write C, compile it into a library and load that."""
    path.with_suffix(".c").write_text(text, encoding="utf-8")
    done = gcc(path.parent, *words, "-shared", "-fPIC", f"{path.stem}.c", "-o", path.name, "-lm")
    assert done.returncode == 0, done.stderr
    return ctypes.CDLL(str(path))


@pytest.fixture
def compiled(tmp_path):
    """A controller as C that is loaded."""

    def load(controller):
        assert controller_problems(controller) == []
        return loaded(tmp_path / "controller.so", source.write(controller, bare=True))

    return load


def infer(library: ctypes.CDLL, name: str, system: FuzzySystem, rows: Floats) -> Floats:
    """Call a C function for each row."""
    prefix = "bare_infer" if hasattr(library, f"bare_infer_{name}") else "infer"
    function = getattr(library, f"{prefix}_{name}")
    pointer = ctypes.POINTER(ctypes.c_double)
    outputs = np.empty((len(rows), len(system.outputs)))
    for row, result in zip(np.ascontiguousarray(rows), outputs, strict=True):
        if len(system.outputs) == 1:
            function.restype = ctypes.c_double
            result[0] = function(row.ctypes.data_as(pointer))
        else:
            function.restype = None
            function(row.ctypes.data_as(pointer), result.ctypes.data_as(pointer))
    return outputs


def assert_equal(outputs: Floats, system: FuzzySystem, rows: Floats) -> None:
    step_by_step.assert_near(outputs, step_by_step.evaluate(system, rows), system)


def test_tables_of_inputs_hold_only_the_points_where_a_term_bends():
    text = source.write(read_controller(SHIPPED["champion_27"]))
    sizes = re.findall(r"memberships_force_x__(\w+)\[3\]\[(\d+)\]", text)
    assert sizes == [("aim_radial", "3"), ("predicted_centre_along_track", "3")]


def test_bends_too_slight_to_see_are_kept_where_they_add_up(compiled):
    wide = Variable("x", "", 0.0, 1.0, (Term("wide", shapes.Gaussian(0.5, 2e4)),), 1001)
    y = Variable("y", "", 0.0, 1.0, (Term("up", shapes.Triangular(0.0, 1.0, 1.0)),), default=0.0)
    system = FuzzySystem("s", (wide,), (y,), (Rule(Is("x", "wide"), (Consequent("y", "up"),)),))
    rows = np.linspace(0.0, 1.0, 101)[:, np.newaxis]
    assert "universe_s__x[1001]" in source.write(FuzzyController("c", (system,)))
    assert_equal(infer(compiled(FuzzyController("c", (system,))), "s", system, rows), system, rows)


def test_systems_of_other_programs_give_what_python_gives(compiled):
    """Of MATLAB, fuzzylite and jFuzzyLogic, also at inputs beyond their ranges."""
    systems = [
        replace(system, name=f"system {number}")
        for number, system in enumerate(random_systems.sampled_systems(95, 40))
        if not any(system.joins_numbers(output) for output in system.outputs)
    ]
    library = compiled(FuzzyController("many", tuple(systems)))
    for system in systems:
        rows = random_systems.inputs_beyond(system, np.random.default_rng(96), 30)
        assert_equal(infer(library, system.name.replace(" ", "_"), system, rows), system, rows)


@pytest.mark.slow
def test_systems_of_all_kinds_give_what_python_gives(compiled):
    systems = []
    for seed in range(40):
        generator = np.random.default_rng([50, seed])
        system = random_general_system(generator) if seed % 4 else full_table_system(generator, 2)
        system = random_systems.hedged(system, generator) if seed % 2 else system
        systems.append(replace(system, name=f"system {seed}"))
    library = compiled(FuzzyController("many", tuple(systems)))
    num_defaults = 0
    for seed, system in enumerate(systems):
        rows = inputs_for(system, np.random.default_rng([51, seed]), 50)
        outputs = infer(library, f"system_{seed}", system, rows)
        assert_equal(outputs, system, rows)
        num_defaults += int((outputs == [variable.default for variable in system.outputs]).sum())
    assert num_defaults > 50
    kinds = {(s.and_operator_of(r), s.or_operator_of(r)) for s in systems for r in s.rules}
    assert len({word for pair in kinds for word in pair}) == 14
    assert len({system.defuzzifier_of(output) for system in systems for output in system.outputs}) == 5


def otherwise_controller() -> FuzzyController:
    """Each operator once; of two outputs one that cuts, where an implication by min allows it."""
    generator = np.random.default_rng(71)
    systems = []
    for implication, aggregation in zip([*AND_OPERATORS, "min"], AGGREGATIONS, strict=True):
        system = random_systems.otherwise(random_general_system(generator), implication, aggregation)
        first, *others = system.outputs
        outputs = (replace(first, aggregation="max"), *others) if others else system.outputs
        systems.append(replace(system, name=f"s{len(systems)}", outputs=outputs))
    return FuzzyController("otherwise", tuple(systems))


@pytest.mark.parametrize(
    "controller",
    [
        GENERAL,
        PAPER_LIKE,
        read_controller(SHIPPED["paper_champion"]),
        otherwise_controller(),
        FuzzyController("weighed", tuple(replace(s, name=n) for n, s in weighed_systems.SYSTEMS.items())),
    ],
    ids=lambda controller: controller.name,
)
def test_controllers_give_what_python_gives(controller, compiled):
    library = compiled(controller)
    for system in controller.systems:
        rows = inputs_for(system, np.random.default_rng(6), 60)
        assert_equal(infer(library, system.name, system, rows), system, rows)


def test_the_ends_and_beyond_and_no_number(compiled):
    controller = FuzzyController("both", (FORCE_X, *GENERAL.systems))
    library = compiled(controller)
    for system in controller.systems:
        (a, c), (b, d) = step_by_step.ends(system)
        beyond = infer(library, system.name, system, np.array([[-np.inf, np.inf], [b + 7.0, c - 7.0]]))
        at_ends = infer(library, system.name, system, np.array([[a, d], [b, c]]))
        np.testing.assert_array_equal(beyond, at_ends)
        missing = infer(library, system.name, system, np.array([[np.nan, d], [a, np.nan]]))
        assert np.isnan(missing).all()


def test_it_refuses_arithmetic_that_is_not_exact(tmp_path):
    (tmp_path / "controller.c").write_text(source.write(GENERAL), encoding="utf-8")
    done = gcc(tmp_path, "-ffast-math", "-c", "controller.c")
    assert done.returncode != 0
    assert "compile without -ffast-math" in done.stderr


def test_it_reads_like_the_controller():
    text = source.write(PAPER_LIKE)
    words = " ".join(re.sub(r"\s*\n\s*\* ?", " ", text).split())
    for system in PAPER_LIKE.systems:
        for number, rule in enumerate(system.rules, start=1):
            assert f"Rule {number}: {sentence(rule)}." in words
        assert f"double infer_{system.name}(const double inputs[{len(system.inputs)}]);" in text
    assert "force_axes: body" in words
    assert "paper: AAS 25-727" in words
    assert "inputs[0] is distance (m), 0 to 200." in words
    assert "The result is force_x (N), -0.1 to 0.1; 0 when no rule fires." in words
    assert max(map(len, text.splitlines())) <= 110


def test_names_from_anywhere_are_no_danger(compiled):
    """Names that are alike once written in C, keywords, ends of comments, and letters of other alphabets."""
    shape = shapes.Triangular(0.0, 1.0, 1.0)
    terms = (Term("*/ int x; /*", shape), Term("size?" + "?/", shapes.Triangular(0.0, 0.0, 1.0)))
    names = ("double", "main", "a b", "a_b", "über", "風", "0")
    inputs = tuple(Variable(name, "", 0.0, 1.0, terms, 11, description="*/") for name in names)
    output = Variable("exp", "%s\\", 0.0, 1.0, terms, 11, default=0.0)
    statements = tuple(Is(name, terms[0].name) for name in names)
    rules = (
        Rule(And(statements), (Consequent("exp", terms[0].name),)),
        Rule(statements[5], (Consequent("exp", terms[1].name, 0.5),), label="a \\"),
    )
    kept = {"a b": "a_b", "a_b": "a_b_2", "a  b": "a_b_3", "風": "unnamed", "switch": "switch", "1": "1"}
    systems = tuple(FuzzySystem(name, inputs, (output,), rules) for name in kept)
    controller = FuzzyController("/* \\", systems, provenance=(("key", "many\nlines */ of it"),))
    library = compiled(controller)
    rows = np.random.default_rng(3).uniform(0, 1, (20, len(names)))
    for system in systems:
        assert_equal(infer(library, kept[system.name], system, rows), system, rows)


def stepped(path: Path, system: FuzzySystem, rows: np.ndarray) -> np.ndarray:
    """Feed rows to an FMU, one a second, and return its answers, (n, num_outputs)."""
    names = [variable.name for variable in system.inputs]
    columns = [("time", float), *((name, float) for name in names)]
    # each row stands from its second to the next: a step, and not a line, leads from one to another
    times = np.repeat(np.arange(len(rows) + 1.0), 2)[1:-1]
    held = [(time, *row) for time, row in zip(times, np.repeat(rows, 2, axis=0), strict=True)]
    simulated = simulate_fmu(
        str(path),
        stop_time=float(len(rows)),
        output_interval=1.0,
        input=np.array(held, dtype=columns),
        output=[variable.name for variable in system.outputs],
        fmi_type="CoSimulation",
    )
    return np.stack([simulated[variable.name] for variable in system.outputs], axis=1)[1:]


@pytest.mark.parametrize("name", ["tipper", "mixed"])
def test_a_block_answers_as_the_compiled_system(name, tmp_path, saved, run):
    program("gcc", "gcc")
    controller = load(TIPPER) if name == "tipper" else FuzzyController("mixed", (weighed_systems.mixed(),))
    (system,) = controller.systems
    path = tmp_path / "system.fmu"
    run("export", saved(controller), "--format", "fmu", "-o", path)
    assert validate_fmu(str(path)) == []
    rows = weighed_systems.samples(system, 60)
    np.testing.assert_allclose(stepped(path, system, rows), compile(system)(rows), rtol=0.0, atol=1e-12)


def test_two_archives_of_a_system_hold_the_same_source():
    first, second = (zipfile.ZipFile(io.BytesIO(fmu.pack(load(TIPPER), "00ff")[0])) for _ in range(2))
    for name in ("modelDescription.xml", "sources/system.c", "sources/fmi2.c"):
        assert first.read(name) == second.read(name)
        assert first.getinfo(name).date_time == (1980, 1, 1, 0, 0, 0)


def test_without_gcc_the_source_remains(tmp_path, monkeypatch, run):
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert "the source alone" in run("export", TIPPER, "--format", "fmu", "-o", tmp_path / "out").err
    names = zipfile.ZipFile(tmp_path / "out" / "tipper.fmu").namelist()
    assert names == ["modelDescription.xml", "sources/system.c", "sources/fmi2.c"]


def test_what_an_archive_cannot_say_is_told(tmp_path, refused):
    for words, said in (
        ([TIPPER], "an FMU is an archive and cannot be printed; add -o"),
        ([SHIPPED["champion_27"], "-o", tmp_path / "champion.fmu"], "has several systems"),
    ):
        assert said in refused("export", *words, "--format", "fmu")
