"""The operators against fuzzylite's norms, and against the laws that make a norm."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from fis_tools.model.operators import ACCUMULATIONS, AND_OPERATORS, OR_OPERATORS, Operator
from tests.programs import library, program

#: Degrees with exact sums, so that no side of a comparison is a matter of rounding.
DEGREES = np.array([0.0, 1 / 1024, 0.125, 0.25, 0.3125, 0.5, 0.6875, 0.75, 0.875, 1023 / 1024, 1.0])
A, B = (grid.ravel() for grid in np.meshgrid(DEGREES, DEGREES))

FUZZYLITE = {
    "min": "Minimum",
    "product": "AlgebraicProduct",
    "bounded_difference": "BoundedDifference",
    "einstein_product": "EinsteinProduct",
    "hamacher_product": "HamacherProduct",
    "drastic_product": "DrasticProduct",
    "nilpotent_minimum": "NilpotentMinimum",
    "max": "Maximum",
    "probabilistic_sum": "AlgebraicSum",
    "bounded_sum": "BoundedSum",
    "einstein_sum": "EinsteinSum",
    "hamacher_sum": "HamacherSum",
    "drastic_sum": "DrasticSum",
    "nilpotent_maximum": "NilpotentMaximum",
}
OPERATORS: dict[str, Operator] = {**AND_OPERATORS, **OR_OPERATORS}


def _fuzzylite_table(folder: Path) -> dict[str, list[float]]:
    """Every norm of fuzzylite at every pair of degrees, by a program of a few lines."""
    compiler = program("g++", "g++")
    library("/usr/include/fl/norm/Norm.h", "libfuzzylite-dev")
    kinds = {name: "t" if name in AND_OPERATORS else "s" for name in FUZZYLITE}
    includes = "".join(f"#include <fl/norm/{kinds[name]}/{norm}.h>\n" for name, norm in FUZZYLITE.items())
    pairs = ", ".join(f"{{{a!r}, {b!r}}}" for a, b in zip(A.tolist(), B.tolist(), strict=True))
    calls = "".join(
        f'    for (auto& p : pairs) std::printf("{name} %.17g\\n", fl::{norm}().compute(p[0], p[1]));\n'
        for name, norm in FUZZYLITE.items()
    )
    source = folder / "norms.cpp"
    source.write_text(
        f"#include <cstdio>\n{includes}const double pairs[][2] = {{{pairs}}};\nint main() {{\n{calls}}}\n"
    )
    binary = folder / "norms"
    subprocess.run([compiler, str(source), "-lfuzzylite", "-o", str(binary)], check=True)  # noqa: S603
    printed = subprocess.run([str(binary)], check=True, capture_output=True, text=True).stdout  # noqa: S603
    table: dict[str, list[float]] = {name: [] for name in FUZZYLITE}
    for line in printed.splitlines():
        name, value = line.split()
        table[name].append(float(value))
    return table


def test_every_operator_is_fuzzylites(tmp_path: Path) -> None:
    table = _fuzzylite_table(tmp_path)
    assert set(table) == set(OPERATORS)
    for name, expected in table.items():
        np.testing.assert_allclose(OPERATORS[name](A, B), expected, rtol=0, atol=1e-15, err_msg=name)


@pytest.mark.parametrize("name", [*AND_OPERATORS, *OR_OPERATORS])
def test_degrees_stay_degrees_next_to_zero_and_one(name: str) -> None:
    ends = [0.0, 5e-324, 1e-300, 1e-16, 0.5, 1.0 - 2**-52, 1.0 - 2**-53, 1.0]
    a, b = (grid.ravel() for grid in np.meshgrid(ends, ends))
    combined = (AND_OPERATORS | OR_OPERATORS)[name](a, b)
    assert np.all((combined >= 0.0) & (combined <= 1.0))
    nearest = np.minimum(a, b) if name in AND_OPERATORS else np.maximum(a, b)
    beyond = combined - nearest if name in AND_OPERATORS else nearest - combined
    assert np.all(beyond <= 1e-15)


def test_single_numbers_combine_as_arrays_do() -> None:
    for name, combine in OPERATORS.items():
        singles = [float(combine(a, b)) for a, b in zip(A.tolist(), B.tolist(), strict=True)]
        np.testing.assert_array_equal(singles, combine(A, B), err_msg=name)


def test_rules_accumulate_by_any_disjunction_or_the_product() -> None:
    assert {name: ACCUMULATIONS[name] for name in OR_OPERATORS} == OR_OPERATORS
    assert set(ACCUMULATIONS) - set(OR_OPERATORS) == {"product"}
