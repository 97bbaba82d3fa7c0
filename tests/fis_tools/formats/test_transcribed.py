"""Functions of inference in C and in JavaScript give the numbers of the compiled ones behind them."""

import ctypes
import inspect
import json
import subprocess

import numpy as np
import pytest

from fis_tools.compiled.decorator import compiled
from fis_tools.engines import codes, defuzzifier, degrees, sampling
from fis_tools.formats.c import source
from fis_tools.formats.c.text import OPENING
from fis_tools.formats.c.transcribed.entries import ENTRIES, specialised
from fis_tools.formats.c.transcribed.folding import NotTranscribed
from fis_tools.formats.c.transcribed.writer import C
from fis_tools.model.operators import ACCUMULATIONS, AGGREGATIONS, AND_OPERATORS, HEDGES, OR_OPERATORS
from fis_tools.review.transcribed import JavaScript, camel
from tests.programs import program

#: what each function of numbers alone is told
SPECIALISED = {
    **{name: (codes.combine, {"operator": code}) for name, code in codes.OPERATORS.items()},
    **{name: (codes.change, {"operator": codes.OPERATORS[name]}) for name in HEDGES},
    **{
        name: (degrees.formula, {"kind": code})
        for name, code in degrees.KINDS.items()
        if code != degrees.TABLE
    },
    **{
        f"where {shape.entry.name}": (defuzzifier.invert, {"kind": k})
        for k, shape in enumerate(codes.INVERTED)
    },
    "counted": (degrees.counted, {}),
}
#: numbers that functions tell apart
SPECIAL = (0.0, 1.0, 0.5, 0.25, 0.75, 1e-300, 5e-324)


def drawn(count: int) -> np.ndarray:
    generator = np.random.default_rng(5)
    rows = generator.random((300, count))
    rows[::3] = generator.choice(SPECIAL, (100, count))
    return rows


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """For each function of numbers alone what Python, C and JavaScript give at the same numbers."""
    folder = tmp_path_factory.mktemp("transcribed")
    functions = {name: specialised(function, **known) for name, (function, known) in SPECIALISED.items()}
    parts = {each.name: each for function in functions.values() for each in function.called}
    texts = [C().text(part).removeprefix("static ") for part in parts.values()]
    text = "".join([OPENING, *(t.replace("\nstatic ", "\n") for t in texts)])
    (folder / "all.c").write_text(text, "utf-8")
    words = [*source.FLAGS.replace("-Wmissing-prototypes", "").split(), "-O2", "-shared", "-fPIC"]
    command = [program("gcc", "gcc"), *words, "all.c", "-o", "all.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)  # noqa: S603
    library = ctypes.CDLL(str(folder / "all.so"))
    rows = {name: drawn(len(function.parameters)).tolist() for name, function in functions.items()}
    script = "".join(map(JavaScript().text, parts.values()))
    pairs = ", ".join(f"[{camel(functions[name].name)}, {json.dumps(rows[name])}]" for name in rows)
    texts = f"[{pairs}].map(([f, rows]) => rows.map((row) => String(f(...row))))"
    (folder / "all.js").write_text(f"{script}console.log(JSON.stringify({texts}));", "utf-8")
    run = subprocess.run(  # noqa: S603
        [program("node", "nodejs"), "all.js"], cwd=folder, check=True, capture_output=True, text=True
    )
    in_javascript = [
        [float(answer.replace("Infinity", "inf")) for answer in part] for part in json.loads(run.stdout)
    ]
    by_name = {}
    for (name, (function, known)), page in zip(SPECIALISED.items(), in_javascript, strict=True):
        in_c = getattr(library, functions[name].name)
        in_c.restype, in_c.argtypes = ctypes.c_double, [ctypes.c_double] * len(rows[name][0])
        names = list(inspect.signature(function.py_func).parameters)
        plain = []
        for row in rows[name]:
            full = dict.fromkeys(names, 0.0) | dict(
                zip([names[p] for p in functions[name].positions], row, strict=True)
            )
            plain.append(function(*(full | known).values()))
        by_name[name] = np.array([plain, [in_c(*row) for row in rows[name]], page])
    return by_name


@pytest.mark.parametrize("name", SPECIALISED)
def test_c_gives_the_bits_of_python_and_javascript_its_numbers(answers, name):
    is_number = np.isfinite(answers[name][0])  # a ramp of no width has none
    python, c, javascript = answers[name][:, is_number]
    assert is_number.mean() > 0.7
    assert len(set(python.tolist())) > 2
    np.testing.assert_array_equal(c, python)
    # exponentials and cosines of browsers may differ in the last digit
    np.testing.assert_allclose(javascript, python, rtol=1e-14, atol=1e-15)


def test_what_the_model_registers_is_transcribed():
    named = {
        f"fuzzy_{name}" for name in {*AND_OPERATORS, *OR_OPERATORS, *HEDGES, *ACCUMULATIONS, *AGGREGATIONS}
    }
    assert named <= ENTRIES.keys()
    assert all(ENTRIES[name]().name == name for name in ENTRIES)


def test_what_is_not_asked_for_is_left_out():
    """Of MATLAB's bisector the others' walks, of a mean of maxima the ends, of an operator all others."""
    bisector = specialised(sampling._sampled_bisector, sampling=codes.MATLAB)
    assert bisector.parameters == ["x", "heights"]
    assert "low" not in bisector.kinds
    mean = C().text(specialised(sampling._sampled_maximum, sampling=codes.FCL, method=codes.MEAN_OF_MAXIMUM))
    assert "best" not in mean
    assert "extreme" not in mean
    assert C().text(specialised(codes.combine, operator=codes.PRODUCT)).count("return") == 1


@compiled
def _with_else_of_a_loop(x: float) -> float:
    for index in range(3):
        x += index
    else:  # noqa: PLW0120 - it is what is refused
        x = 0.0
    return x


@compiled
def _raising(x: float) -> float:
    return x**3.0


@compiled
def _crossed(x: float, y: float) -> float:
    x, y = y, x
    return x - y


@pytest.mark.parametrize("function", [_with_else_of_a_loop, _raising, _crossed])
@pytest.mark.parametrize("language", [C, JavaScript])
def test_what_is_not_modelled_is_refused(function, language):
    with pytest.raises(NotTranscribed):
        language().text(specialised(function))
