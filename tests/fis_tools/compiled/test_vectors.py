"""Vectors against NumPy, compiled; and the same where numba is switched off."""

import gc
import math
import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numba import TypingError, njit
from numpy.typing import NDArray

from fis_tools.compiled import borrowed_code, vector_types, vectors  # noqa: F401 - teaches numba what vectors are
from fis_tools.compiled.vectors import Three, borrowed, least, load, most, select, splat, store, total
from tests.places import PROJECT

Floats = NDArray[np.float64]
Kernel = Callable[..., None]

#: narrower and wider than the registers of any processor
WIDTHS = (1, 2, 8, 16, vector_types.MOST_LANES)
SPECIAL = [0.0, -0.0, np.inf, -np.inf, np.nan, 5e-324, -1e-310, 1.7e308, 0.5, 2.5, -3.5, 1e17]

is_plain = os.environ.get("NUMBA_DISABLE_JIT") == "1"
when_compiled = pytest.mark.skipif(is_plain, reason="numba is switched off: nothing is typed")


@pytest.fixture(scope="module", params=WIDTHS)
def width(request):
    return request.param


def assert_same(values: Floats, expected: Floats) -> None:
    """Equal to the last bit, signs of zeros included; any NaN is like any other."""
    np.testing.assert_array_equal(values, expected)
    is_number = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(values)[is_number], np.signbit(expected)[is_number])


def pairs(width: int) -> st.SearchStrategy[Floats]:
    """Two rows of numbers, among them those that are easily got wrong."""
    numbers = st.sampled_from(SPECIAL) | st.floats(-1e3, 1e3)
    return arrays(np.float64, (2, width), elements=numbers)


def computed(x, y, number, z):
    """Numbers that are written alike of vectors and of NumPy's rows."""
    z += x
    z *= 3
    z -= y
    z /= number
    roots = np.sqrt(abs(x)), np.floor(x), np.rint(x)
    return x + y, x - y, x * y, x / y, -x, abs(x), *roots, number - x, x / number, 2 * x, z


def compared(x, y, number):
    """Masks that are."""
    mask = ~(x < number)
    mask &= y > -number
    is_less, is_above = x < y, x > number
    return x == y, x != y, is_less & is_above, is_less | is_above, is_less ^ is_above, mask


def chosen(x, y, number):
    """What stands for branches."""
    bounded = least(x, y), most(x, y), least(x, number), most(0, x)
    picked = select(x < y, x, y), select(x <= y, 1.0, 0), select(x > y, x, number), select(x >= y, 1, y)
    return bounded + picked


def chosen_by_numpy(x, y, number):
    bounded = np.where(x < y, x, y), np.where(x > y, x, y), np.where(x < number, x, number)
    above_zero = np.where(x < 0.0, 0.0, x)
    picked = np.where(x < y, x, y), np.where(x <= y, 1.0, 0.0), np.where(x > y, x, number)
    return *bounded, above_zero, *picked, np.where(x >= y, 1.0, y)


@cache
def in_lanes(width: int) -> Kernel:
    numbers, masks, choices = map(njit(error_model="numpy"), (computed, compared, chosen))

    @njit(error_model="numpy")
    def run(a: Floats, b: Floats, number: float, out: Floats, whole: NDArray[np.uint64]) -> None:
        x, y = load(a, 0, width), load(b, 0, width)
        results = numbers(x, y, number, splat(number, width)) + choices(x, y, number)
        for i in range(len(results)):
            store(out, i, results[i])
        held = masks(x, y, number)
        for i in range(len(held)):
            store(out, len(results) + i, select(held[i], 1.0, 0.0))
        whole[0] = vectors.count(x < y)
        whole[1] = vectors.some(x < y)

    return run


@settings(max_examples=100, deadline=None)
@given(data=st.data(), number=st.floats(-2.0, 10.0))
def test_arithmetic_comparisons_and_choices_are_those_of_numpy(width, data, number) -> None:
    x, y = data.draw(pairs(width))
    out, whole = np.zeros((27, width)), np.zeros(2, dtype=np.uint64)
    with np.errstate(all="ignore"):
        in_lanes(width)(x, y, number, out, whole)
        expected = [*computed(x, y, number, np.full(width, number)), *chosen_by_numpy(x, y, number)]
    expected += [mask.astype(np.float64) for mask in compared(x, y, number)]
    for row, truth in zip(out, expected, strict=True):
        assert_same(row, truth)
    assert whole.tolist() == [(x < y).sum(), (x < y).any()]


def path_in_lanes(numbers: Floats, width: int, factor: int, out: Floats) -> float:
    """Do with three-vectors all that they can."""
    position = Three(load(numbers, 0, width), load(numbers, 1, width), load(numbers, 2, width))
    steady = Three(0.5, -2.0, factor)
    moved = position - 2.5 * steady + position.x * steady / position.y
    moved += load(numbers, 3, width) * position
    moved -= steady * factor
    moved *= position.z
    moved /= factor
    store(out, 0, moved.x)
    store(out, 1, moved.y)
    store(out, 2, moved.z)
    return (steady + steady * factor - steady / 4).z


def test_three_vectors_compute_by_components(width: int) -> None:
    x = np.random.default_rng(width).uniform(1.0, 2.0, (4, width))

    @njit(error_model="numpy")
    def run(numbers: Floats, factor: int, out: Floats) -> float:
        return path(numbers, width, factor, out)

    path, moved, plain = njit(error_model="numpy")(path_in_lanes), np.zeros((3, width)), np.zeros((3, width))
    steady = np.array([[0.5], [-2.0], [3.0]])
    expected = x[:3] - 2.5 * steady + x[0] * steady / x[1]
    expected = (expected + x[3] * x[:3] - steady * 3) * x[2] / 3
    assert run(x, 3, moved) == path_in_lanes(x, width, 3, plain) == 11.25
    assert_same(moved, expected)
    assert_same(plain, expected)


@cache
def sums(width: int) -> Callable[[Floats], float]:
    @njit(error_model="numpy")
    def run(a: Floats) -> float:
        return total(load(a, 0, width))

    return run


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_sums(width: int, data: st.DataObject) -> None:
    x = data.draw(arrays(np.float64, width, elements=st.floats(-1e6, 1e6)))
    bound = 2.3e-16 * math.log2(2 * width) * np.abs(x).sum()
    assert abs(sums(width)(x) - math.fsum(x)) <= bound


def test_a_sum_is_taken_by_halves() -> None:
    # (1e17 + 1) + (1 - 1e17), where adding from the left gives 0 and exactly it were 2
    assert sums(8)(np.array([1e17, 1.0, 0.0, 0.0, -1e17, 1.0, 0.0, 0.0])) == 2.0
    assert sums(8)(np.array([1e17, -1e17, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0])) == 0.0


@cache
def accesses(width: int) -> Kernel:
    @njit(error_model="numpy")
    def run(flat: Floats, table: Floats, at: int, offsets: Floats, out: Floats, rows: Floats) -> None:
        store(out, 0, load(flat, at, width))
        store(out, 1, load(table, at, width))
        store(out, 2, vectors.spread(flat, at, width))
        store(out, 3, vectors.gather(flat, at, load(offsets, 0, width)))
        vectors.gather_rows(flat, at, load(offsets, 0, width), len(rows) - 1, rows)
        store(out, 4, vectors.power_of_two(load(offsets, 0, width) - 500.0))
        before = load(out, 0, width)
        store(out, 0, splat(7, width))  # what has been read stays as it was
        store(flat, at + 1, before)

    return run


def test_vectors_are_read_and_written_where_one_says(width: int) -> None:
    generator = np.random.default_rng(width)
    flat, table = generator.random(200), generator.random((5, width + 3))
    offsets = generator.integers(-3, 100, width) + 0.0
    offsets += np.sign(offsets) * generator.choice([0.0, 0.999], width)  # the fraction is cut off
    before, out = flat.copy(), np.zeros((5, width))
    for size in range(vectors.ROW, -1, -1):
        rows = np.full((size + 1, width), np.nan)
        accesses(width)(flat := before.copy(), table, 3, offsets, out, rows)
        assert_same(rows[:size], before[3 + np.trunc(offsets).astype(int) + np.arange(size)[:, np.newaxis]])
        assert np.isnan(rows[size]).all()
    assert_same(out[0], np.full(width, 7.0))
    assert_same(out[1], table[3, :width])
    assert_same(out[2], np.full(width, before[3]))
    assert_same(out[3], before[3 + np.trunc(offsets).astype(int)])
    expected = before.copy()
    expected[4 : 4 + width] = before[3 : 3 + width]
    assert_same(flat, expected)


def test_powers_of_two_are_exact_over_all_normal_numbers() -> None:
    exponents = np.arange(-1022.0, 1024.0)
    exponents = np.resize(exponents, vectors.padded(len(exponents), 64))

    @njit(error_model="numpy")
    def run(exponents: Floats, out: Floats) -> None:
        for at in range(0, len(exponents), 64):
            store(out, at, vectors.power_of_two(load(exponents, at, 64)))

    out = np.zeros(len(exponents))
    run(exponents, out)
    assert_same(out, np.ldexp(1.0, exponents.astype(int)))


@njit(error_model="numpy")
def clipped_root(x: float, limit: float) -> float:
    """A function as one writes it for floats."""
    return select(x > 0.0, least(np.sqrt(abs(x)), limit), -limit)


@njit(error_model="numpy")
def roots(a: Floats, out: Floats) -> None:
    store(out, 0, clipped_root(load(a, 0, 8), 1.5))
    out[8] = clipped_root(a[3], 1.5)


def test_a_function_for_floats_works_on_vectors() -> None:
    a, out = np.array([-1.0, 0.0, 0.25, 1.0, 2.0, 4.0, 9.0, np.inf]), np.zeros(9)
    roots(a, out)
    assert_same(out, np.array([-1.5, -1.5, 0.5, 1.0, math.sqrt(2.0), 1.5, 1.5, 1.5, 1.0]))


@njit(error_model="numpy")
def record_total(room: NDArray[np.void]) -> float:
    square, lane = room[0].square, 0.0
    width = vectors.width_of(room[0])
    store(square, (1, 1, 0), 2.0 * load(square, (0, 1, 0), width))
    for number in range(vectors.width_of(room[0].row)):
        lane += number
    return total(load(square, (1, 1, 0), vectors.width_of(square))) + lane


def test_the_type_of_a_record_tells_how_wide_its_rows_are(width: int) -> None:
    room = vectors.make_rows({"row": (), "square": (2, 2)}, width, 3)
    assert (room.shape, room.row.shape, room.square.shape) == ((3,), (3, width), (3, 2, 2, width))
    room[0].square[0, 1] = np.arange(float(width))
    assert record_total(room) == 1.5 * width * (width - 1)
    assert_same(room[0].square[1, 1], 2.0 * np.arange(width))


@pytest.mark.parametrize("length", [1, 3, 1000])
def test_aligned_rooms_begin_with_a_line_of_the_cache_and_are_empty(length: int) -> None:
    for kind in (np.float64, np.dtype([("x", np.float64, 16)])):
        room = vectors.aligned(length, kind)
        assert room.ctypes.data % vectors.CACHE_LINE == 0
        assert (room.shape, room.dtype) == ((length,), np.dtype(kind))
        assert not room.tobytes().strip(b"\0")


@pytest.mark.parametrize(("number", "width", "lanes"), [(0, 8, 0), (1, 8, 8), (8, 8, 8), (99, 8, 104)])
def test_padded_lengths_are_whole_vectors(number: int, width: int, lanes: int) -> None:
    assert vectors.padded(number, width) == lanes


def test_vectors_are_read_and_written_anywhere_in_a_row() -> None:
    @njit
    def run(a: Floats, row: int, out: Floats) -> None:
        store(out, (row, 1, 3), load(a, (row, 0, 2), 4))
        store(out, (0, 0, 4), load(a, (1, row, 0), 4))

    room = np.arange(2 * 3 * 10.0).reshape(2, 3, 10)
    written, expected = np.zeros((2, 3, 10)), np.zeros((2, 3, 10))
    expected[1, 1, 3:7] = room[1, 0, 2:6]
    expected[0, 0, 4:8] = room[1, 1, :4]
    run(room, 1, written)
    assert_same(written, expected)


def test_borrowed_arrays_are_the_same_and_still_their_owners() -> None:
    @njit
    def run(pair: tuple[Floats, tuple[Floats, int]]) -> float:
        row, (other, number) = borrowed(pair)
        row[0] = other[1] + number
        return total(load(borrowed(row), 0, 4))

    row, other = np.arange(4.0), np.array([5.0, 6.0])
    run((row, (other, 2)))
    gc.collect()  # what compiling has left behind may hold them
    before = sys.getrefcount(row), sys.getrefcount(other)
    for _ in range(100):
        assert run((row, (other, 2))) == 8.0 + 1.0 + 2.0 + 3.0
    assert (sys.getrefcount(row), sys.getrefcount(other)) == before


class Inner(NamedTuple):
    row: Floats
    times: int


class Outer(NamedTuple):
    count: int
    is_on: bool
    row: Floats
    inner: Inner
    even: tuple[float, float]
    step: float


def test_named_tuples_are_borrowed_whole() -> None:
    @njit
    def of_inner(inner: Inner) -> float:
        return inner.row[1] * inner.times

    @njit
    def of_outer(outer: Outer, factor: float) -> float:
        value = outer.step if outer.is_on else 0.0
        for i in range(outer.count):
            value += outer.row[i] * factor
        outer.row[0] = 7.0
        return value + of_inner(outer.inner) + outer.even[1]

    @njit
    def run(outer: Outer, other: Floats) -> float:
        outer, other = borrowed((outer, other))
        return of_outer(outer, 2.0) + other[0]

    row, other = np.arange(5.0), np.array([100.0])
    outer = Outer(5, True, row, Inner(np.array([1.0, 1.5]), 4), (9.0, 3.0), 0.5)
    before = sys.getrefcount(row), sys.getrefcount(outer.inner.row)
    assert run(outer, other) == 0.5 + 2.0 * 10.0 + 1.5 * 4 + 3.0 + 100.0
    assert row[0] == 7.0
    assert run(outer._replace(is_on=False), other) == 2.0 * 17.0 + 1.5 * 4 + 3.0 + 100.0
    assert (sys.getrefcount(row), sys.getrefcount(outer.inner.row)) == before


NO_VECTORS = "pass an array of float64 in C order"


@when_compiled
@pytest.mark.parametrize(
    ("function", "argument", "message"),
    [
        (lambda a: total(load(a, 0, 0)), np.zeros(200), "cannot be 0 wide; choose a power of two up to 64"),
        (lambda a: total(load(a, 0, 3)), np.zeros(200), "cannot be 3 wide; choose a power of two up to 64"),
        (lambda a: total(load(a, 0, 12)), np.zeros(200), "cannot be 12 wide; choose a power of two up to 64"),
        (lambda a: total(load(a, 0, 128)), np.zeros(200), "cannot be 128 wide; choose a power of two up"),
        (lambda a: total(load(a, 0, len(a))), np.zeros(8), "the width of a vector is int64; pass a constant"),
        (lambda a: total(load(a, 0, 8)), np.zeros(16)[::2], NO_VECTORS),
        (lambda a: total(load(a, 0, 8)), np.zeros(8, dtype=np.float32), NO_VECTORS),
        (lambda a: total(load(a, 0, 8)), np.zeros((1, 1, 1, 8)), NO_VECTORS),
        (lambda a: total(load(a, (0, 0), 8)), np.zeros((2, 2, 8)), "a whole number for each dimension"),
        (lambda a: 1 * vectors.width_of(a), np.zeros((2, 8)), "width_of"),
        (lambda a: total(load(a, 0, 8) + load(a, 0, 4)), np.zeros(8), r"Vector\(8\), Vector\(4\)"),
        (lambda inner: borrowed(inner).rows[0], Inner(np.zeros(2), 1), "attribute 'rows'"),
    ],
)
def test_what_cannot_be_is_refused_while_it_is_compiled(function, argument, message):
    with pytest.raises(TypingError, match=message):
        njit(function)(argument)


@when_compiled
def test_a_numba_without_what_vectors_need_is_told_with_its_cure() -> None:
    missing = "import numba.core.typing.templates as t; del t.infer_global; "
    command = [sys.executable, "-c", missing + "import fis_tools.compiled.vector_code"]
    done = subprocess.run(command, check=False, cwd=PROJECT, capture_output=True, text=True)  # noqa: S603
    assert done.returncode != 0
    assert "lacks what compiled vectors are made with" in done.stderr
    assert "pip install 'numba>=0.62" in done.stderr


@pytest.mark.parametrize("operation", [np.trunc, np.exp, np.maximum, np.sum, np.logical_and])
def test_plain_vectors_refuse_what_compiled_ones_have_not(operation):
    values = [splat(1.5, 4)] * operation.nin if isinstance(operation, np.ufunc) else [splat(1.5, 4)]
    with pytest.raises(TypeError, match="compiled vectors have no"):
        operation(*values)
    with pytest.raises(TypeError, match="compiled masks have no add; they have bitwise_and"):
        (splat(1.5, 4) > 1.0) + (splat(1.5, 4) > 2.0)
