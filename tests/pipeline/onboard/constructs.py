"""Small functions with constructs that C takes otherwise than Python, or may; what is said of each is tested.

Each works on an array of eight cells and a number. Functions whose docstring begins with "Refused" have no
translation; all others do the same in C.
"""

import math

import numpy as np

from fis_tools.compiled.decorator import compiled


@compiled
def rest_of_negatives(cells, x):
    """Refused: `%` of -8 to 0"""
    k = 0
    for i in range(7):
        if x > 0.0:
            k = k - 1
        cells[i] = float(k % 3)


@compiled
def quotient_of_negatives(cells, x):
    """Refused: `//` of"""
    k = 4
    for _ in range(7):
        if x > 0.0:
            k -= 3
    cells[0] = float(k // 2)


@compiled
def rest_of_a_counter(cells, x):
    """The same: counters are not negative."""
    for i in range(30):
        cells[i % 8] += x * (i // 4)


@compiled
def rest_of_a_sum(cells, x):
    """The same: what is added up in a loop has a range."""
    k = 2
    for i in range(9):
        if x > i:
            k += 3
        cells[k % 8] += 1.0


@compiled
def bits_of_a_counter(cells, x):
    """Refused: stands where a condition is needed"""
    for i in range(10):
        if x > 0.0 and (i & 1) == 1:
            cells[0] += 1.0


@compiled
def bits_of_a_variable(cells, x):
    """Refused: stands where a condition is needed"""
    k = 3
    for i in range(9):
        k = k ^ i
    cells[0] = k + x


@compiled
def opposite_bits(cells, x):
    """Refused: `~`"""
    for i in range(9):
        cells[0] += ~i * x


@compiled
def opposite_of_a_condition(cells, x):
    """Refused: `~`"""
    cells[0] = 1.0 if ~(x > 0.0) else 0.0


@compiled
def value_of_or(cells, x):
    """Refused: stands where a condition is needed"""
    cells[0] = x or 3.0


@compiled
def value_of_and(cells, x):
    """Refused: stands where a condition is needed"""
    cells[0] = x > 1.0 and x


@compiled
def known_value_of_or(cells, x):
    """The same: it is computed while it is translated."""
    known = 0
    cells[0] = (known or 3.0) * x
    cells[1] = (2.0 and 5.0) * x


@compiled
def truth_of_a_number(cells, x):
    """Refused: stands where a condition is needed"""
    if x:
        cells[0] = 1.0


@compiled
def no_number(cells, x):
    """Refused: stands where a condition is needed"""
    cells[0] = 1.0 if not x else 0.0


@compiled
def truth_in_a_choice(cells, x):
    """Refused: stands where a condition is needed"""
    cells[0] = 1.0 if x else 2.0


@compiled
def truth_by_name(cells, x):
    """Refused: stands where a condition is needed"""
    cells[0] = 1.0 if bool(x) else 2.0


@compiled
def counter_after_its_loop(cells, x):
    """Refused: counted a loop"""
    for i in range(9):  # noqa: B007
        cells[1] = cells[1] + x
    cells[0] = float(i)


@compiled
def counter_bound_before(cells, x):
    """Refused: bound before"""
    i = 3
    for i in range(9):  # noqa: B007
        cells[1] = cells[1] + x
    cells[0] = float(i)


@compiled
def counter_of_a_short_loop(cells, x):
    """Refused: bound before"""
    i = 7
    if x > 0.0:
        for i in range(3):
            cells[1] = cells[1] + i * x
    cells[0] = float(i)


@compiled
def counter_twice(cells, x):
    """The same: the second loop begins anew."""
    for i in range(9):
        cells[1] += i * x
    for i in range(2):
        cells[2] += i * x


@compiled
def array_in_a_branch(cells, x):
    """Refused: bound anew"""
    row = cells
    other = np.zeros(8)
    if x > 0.0:
        row = other
    row[0] = 5.0


@compiled
def arrays_exchanged(cells, x):
    """Refused: bound anew"""
    a = np.zeros(8)
    b = np.zeros(8)
    for _ in range(9):
        a[0] = a[0] + x
        a, b = b, a
    cells[0] = a[0]


@compiled
def arrays_by_a_branch(cells, x):
    """Refused: not bound on every way"""
    if x > 0.0:  # noqa: SIM108
        row = cells[1:]
    else:
        row = cells[2:]
    row[0] = 5.0


@compiled
def none_before(cells, x):
    """Refused: bound anew"""
    mode = None
    if x > 0.0:
        mode = 1.0
    if mode is None:
        cells[0] = 7.0


@compiled
def index_before_the_first(cells, x):
    """Refused: an index"""
    for i in range(8):
        cells[i - 1] += x


@compiled
def index_beyond_the_last(cells, x):
    """Refused: an index"""
    for i in range(8):
        cells[i + 1] += x


@compiled
def index_minus_one(cells, x):
    """Refused: index -1"""
    cells[-1] = x


@compiled
def slice_from_the_end(cells, x):
    """Refused: a slice from -2 on"""
    row = cells[-2:]
    row[0] = x


@compiled
def negative_index_of_a_part(cells, x):
    """Refused: an index of a part"""
    for i in range(4):
        cells[0] += cells[3:][i - 2] * x


@compiled
def index_that_is_double(cells, x):
    """Refused: no whole number"""
    cells[x + 1.0] = 1.0


@compiled
def index_in_range(cells, x):
    """The same: the loop's bounds keep it inside."""
    for i in range(1, 8):
        cells[i - 1] += cells[i] * x


@compiled
def part_by_a_variable(cells, x):
    """The same: a part keeps the index that it was taken with."""
    k = 1
    for _ in range(5):
        row = cells[k:]
        if x > 0.5:
            k += 1
        row[1] = x


@compiled
def power_of_ten(cells, x):
    """Refused: 32 bits"""
    k = 1
    for _ in range(12):
        k = k * 10
    cells[0] = k + x


@compiled
def large_number(cells, x):
    """Refused: 32 bits"""
    k = 0
    for _ in range(5):
        if x > 0.0:
            k += 3000000000
    cells[0] = float(k)


@compiled
def large_product(cells, x):
    """Refused: 32 bits"""
    for i in range(100000):
        if i * i > x:
            cells[0] = 1.0


@compiled
def sums_in_range(cells, x):
    """The same: 12,345 times 1,000."""
    k = 0
    for i in range(12345):
        if i > x:
            k += 1000
    cells[0] = float(k)


@compiled
def number_of_a_double(cells, x):
    """Refused: as a whole number"""
    cells[0] = float(int(x))


@compiled
def sign_of_zero(cells, x):
    """The same: the negative of a double zero, and that of a whole one."""
    for i in range(5):
        cells[0] += math.atan2(0.0, -float(i)) + math.atan2(x, -i)


@compiled
def zero_without_a_sign(cells, x):
    """Refused: write both as one kind"""
    y = 0 if x > 1.0 else 2.5
    cells[0] = math.atan2(0.0, -y)


@compiled
def kinds_of_a_variable(cells, x):
    """Refused: one kind on every way"""
    y = 1.0
    if x > 0.0:
        y = 0
    cells[0] = math.atan2(0.0, -y)


@compiled
def condition_that_becomes_a_number(cells, x):
    """Refused: one kind on every way"""
    y = x > 0.0
    if x > 1.0:
        y = x
    cells[0] = y


@compiled
def whole_number_in_a_choice(cells, x):
    """The same: three has a sign."""
    cells[0] = (3 if x > 0.0 else 2.5) / 2


@compiled
def mixed_extreme(cells, x):
    """Refused: write both as one kind"""
    for i in range(6):
        cells[0] += min(i, x)


@compiled
def extreme_of_one(cells, x):
    """Refused: give it two numbers or more"""
    cells[0] = max((x, 1.0))


@compiled
def extremes(cells, x):
    """The same: the first of equal numbers, and what NaN leaves."""
    cells[0] = max(x, 1.0)
    cells[1] = max(1.0, x)
    cells[2] = min(x, 1.0)
    cells[3] = min(1.0, x)
    cells[4] = max(0.0, -0.0 * x)
    cells[5] = min(1.0, x, 0.5)


@compiled
def condition_as_a_number(cells, x):
    """Refused: where a condition is to be a number"""
    cells[0] = (x > 0.0) * x


@compiled
def difference_of_conditions(cells, x):
    """Refused: where a condition is to be a number"""
    cells[0] = float((x > 0.0) - (x < 2.0))


@compiled
def negative_of_a_condition(cells, x):
    """Refused: the negative of a condition"""
    cells[0] = float(-(x > 0.0))


@compiled
def condition_equal_to_a_number(cells, x):
    """Refused: compare numbers with numbers"""
    cells[0] = 1.0 if (x > 0.0) == 1.0 else 0.0


@compiled
def count_from_five(cells, x):
    """The same: what counts conditions need not begin with zero."""
    n = 5
    for i in range(6):
        n += x > i
    cells[0] = float(n)


@compiled
def count_in_a_double(cells, x):
    """Refused: a count that is no sum"""
    y = 0.5
    for i in range(6):
        y += x > i
    cells[0] = y


@compiled
def bump(cells):
    """Change what it is given."""
    cells[0] = cells[0] + 1.0
    return cells[0]


@compiled
def rises(x, cells):
    """Return one if it raises a cell above a number."""
    count = 0
    if bump(cells) > x:
        count += 1
    return count


@compiled
def call_in_a_target(cells, x):
    """The same: the call is made once, after the value is read."""
    cells[1 + rises(x, cells)] += cells[0]
    cells[rises(x, cells) + 3] = cells[0]


@compiled
def calls_in_a_chain(cells, x):
    """Refused: a chain of comparisons with calls"""
    cells[1] = 1.0 if x < 0.5 < bump(cells) else 0.0


@compiled
def chain(cells, x):
    """The same: the middle is compared with both."""
    cells[0] = 1.0 if 0.0 < x < 2.0 != x else 0.0


@compiled
def several_targets(cells, x):
    """The same: the value is computed once, before a target is written."""
    cells[0] = cells[1] = cells[0] + x


@compiled
def exchange(cells, x):
    """The same: both are read before one is written."""
    a = cells[0]
    cells[0] += x
    a, cells[0] = cells[0], a
    cells[2] = a
    cells[3], cells[4] = cells[4], cells[3]


@compiled
def tuple_of_what_changes(cells, x):
    """The same: its items are computed before the first is taken."""
    k = x
    for y in (cells[0], k, cells[1]):
        k = k + 1.0
        cells[1] = y + k


@compiled
def names_of_c(cells, x):
    """The same: what C calls otherwise gets another name."""
    state = x + 1.0
    double = state * 2.0
    NAN = double + 1.0
    errno = NAN * 2.0
    three = most = fabs = errno + 1.0
    cells[0] = state + double + errno + three + most + fabs


#: a table whose name a local array has elsewhere
zeros = np.arange(8.0)


@compiled
def read_from_a_table(x):
    """Return a number of a table."""
    value = 0.0
    for i in range(8):
        value += zeros[i] * x
    return value


@compiled
def array_called_as_a_table(cells, x):
    """The same: a table and an array of one name are told apart."""
    zeros_2 = np.zeros(8)
    zeros_2[1] = x
    local = np.zeros(8)
    for i in range(8):
        cells[i] = local[i] + zeros_2[i] + zeros[i]
    cells[0] += read_from_a_table(x)


@compiled
def filled(cells, x):
    """The same: the value is read once."""
    cells[:3] = cells[1] * 2.0
    cells[:2] = x


@compiled
def greatest(cells, x):
    """The same: as NumPy's, also where one is NaN."""
    cells[3] = x
    cells[0] = cells[:6].max()
    cells[1] = float(cells[:6].argmax())


@compiled
def comparison_of_arrays(cells, x):
    """Refused: what are no numbers"""
    other = np.zeros(8)
    if cells == other:
        cells[0] = x


@compiled
def identity(cells, x):
    """Refused: `is`"""
    cells[0] = 1.0 if x is cells[0] else 0.0


@compiled
def itself(cells, x):
    """Refused: calls itself"""
    if x > 1.0:
        itself(cells, x - 1.0)


@compiled
def called_while_translated(cells, x):
    """Refused: a call of"""
    cells[0] = x + np.random.rand()  # noqa: NPY002


@compiled
def sorted_numbers(cells, x):
    """Refused: a call of"""
    for y in sorted([x, 1.0]):
        cells[0] += y


@compiled
def power(cells, x):
    """Refused: Pow"""
    cells[0] = x**2


@compiled
def sums_as_written(cells, x):
    """The same: nothing is exchanged or left out."""
    cells[0] = x - (x - 1.0e-17) - 1.0 + 3.0
    cells[1] = 1.0 / 3.0 * x * 3.0
    cells[2] = -x * -x - x / 3.0 / 7.0
    cells[3] = -(x - 1.0) - -x
    cells[4] = x + 0.0


@compiled
def whole_sums(cells, x):
    """The same: known addends are added up."""
    for i in range(9):
        cells[0] += (5 - (i - 3)) - 2 * (4 - i) + (i // 2) * 3 - (3 + i) % 4 + x


@compiled
def ways_out_of_loops(cells, x):
    """The same: continue and break, and downwards by two."""
    for i in range(9, 0, -2):
        if i == 7:
            continue
        if i < x:
            break
        cells[0] = cells[0] * 2.0 + i * x


@compiled
def roundings(cells, x):
    """The same: half goes to even."""
    y = min(max(x, -9.0), 9.0)
    cells[0] = np.floor(-y) + np.rint(y + 0.5) + np.rint(-y - 1.5)


@compiled
def divisions(cells, x):
    """The same: whole numbers divided are a double."""
    for i in range(5):
        cells[0] += i / 2 + 7 / (i + 1) + x


@compiled
def matrix_of_zeros(cells, x):
    """The same: elements of a small matrix, of which some stay zero."""
    matrix = np.zeros((2, 3))
    matrix[0, 1], matrix[1, 2] = x, 2.0 * x
    for i in range(8):
        cells[i] = matrix[0, 1] * i + matrix[1, 2] - matrix[0, 0]


@compiled
def matrix_in_a_branch(cells, x):
    """Refused: an array of known shape is written in a branch or a loop"""
    matrix = np.zeros((2, 3))
    if x > 0.5:
        matrix[0, 1] = x
    for i in range(8):
        cells[i] = matrix[0, 1] * i


@compiled
def maximum_of_zeros(cells, x):
    """The same: of zeros of either sign the first is the maximum, as compiled; NumPy leaves it open."""
    cells[:6] = 0.0
    for i in range(3, 6):
        cells[i] = -abs(cells[i])
    cells[6] = cells[:6].max()
    cells[7] += x


TABLES = np.linspace(0.1, 1.7, 18).reshape(2, 3, 3)


@compiled
def transposed_part(cells, x):
    """The same: numbers of a part of a table, its rows and columns exchanged."""
    for i in range(2):
        cells[i] = TABLES[i].T[0, 1] * x + TABLES[i].T[2, 0]
