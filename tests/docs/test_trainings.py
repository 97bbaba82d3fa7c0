"""What the page on the paper tells of trainings follows from the rows of all trainings, computed anew."""

import re

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.stats import trim_mean

from tests.places import PROJECT

PAGE = (PROJECT / "docs/results/paper.md").read_text(encoding="utf-8")
ROWS = pq.read_table(PROJECT / "docs/results/trainings.parquet").to_pylist()
#: the first words of a row of the page, the measure, and its decimals
MEASURES = (
    ("test: delta-v", "delta_v_m_s", 2),
    ("its standard deviation over starts", "delta_v_deviation_m_s", 2),
    ("points inspected", "inspected_percent", 1),
    ("mean distance", "mean_distance_m", 1),
    ("success", "success_percent", 1),
    ("outside the limits", "outside_percent", 1),
    ("training: delta-v", "training_delta_v_m_s", 2),
)
ORDERS = {"strict": "strict order", "prices": "prices"}
#: of the arms beside the paper's figures, as columns of the page: penalty, outputs and inputs
BESIDE = (("strict", "0.3", "two"), ("prices", "0.3", "two"), ("strict", "1 N", "three"))
#: the changes that the page tells, by their first words
CHANGES = {
    "prices in place": ("prices", "0.3", "two"),
    "outputs up to 1 N": ("strict", "1 N", "two"),
    "three inputs, 375": ("strict", "0.3", "three"),
    "both: three": ("strict", "1 N", "three"),
    "prices, and outputs": ("prices", "1 N", "two"),
    "prices, and three": ("prices", "0.3", "three"),
    "all: prices, three": ("prices", "1 N", "three"),
    "a deputy that still fires": ("strict", "0.3", "two", "fires on once all is seen"),
    "test starts drawn by even": ("strict", "0.3", "two", "test starts by even angles"),
}


def of(penalty, outputs="0.3", inputs="two", alone="as there", *, column=None):
    """The trainings of an arm by their seeds, or a measure of them."""
    chosen = {
        row["seed"]: row
        for row in ROWS
        if ORDERS[penalty] in row["penalty"]
        and outputs in row["outputs"]
        and row["inputs"].startswith(inputs)
        and row["alone"] == alone
    }
    return chosen if column is None else np.array([row[column] for row in chosen.values()])


def test_each_arm_has_the_trainings_of_the_protocol():
    assert [sorted(of(penalty)) for penalty in ORDERS] == [list(range(1001, 1031))] * 2
    for levels in CHANGES.values():
        seeds = sorted(of(*levels))
        assert seeds == list(range(1001, 1001 + len(seeds)))
        assert len(seeds) >= 10
    assert len({row["arm"] for row in ROWS}) == 1 + len(CHANGES)


@pytest.mark.parametrize(("words", "column", "decimals"), MEASURES)
def test_a_row_of_the_page_is_what_the_trainings_came_to(words, column, decimals):
    table = PAGE.partition("| | the paper | 30 trainings, a strict order")[2]
    [row] = [line for line in table.splitlines() if line.startswith(f"| {words}")][:1]
    cells = row.strip("|").split("|")[2:]
    for levels, cell in zip(BESIDE, cells, strict=True):
        values = of(*levels, column=column)
        numbers = re.findall(r"\d+(?:\.\d+)?", re.sub(r"(?<=\d),(?=\d{3})", "", cell))
        mean, low, high, least, greatest = map(float, numbers)
        for printed, value in (
            (mean, trim_mean(values, 0.25)),
            (least, values.min()),
            (greatest, values.max()),
        ):
            assert printed == pytest.approx(value, abs=0.51 * 10.0**-decimals if printed < 1000.0 else 0.51)
        # the bootstrap's interval of the page is about that of other resamples
        generator = np.random.default_rng(5)
        means = [trim_mean(generator.choice(values, len(values)), 0.25) for _ in range(2000)]
        again = np.percentile(means, [2.5, 97.5])
        np.testing.assert_allclose([low, high], again, atol=0.15 * np.ptp(again) + 10.0**-decimals)


def test_the_fuel_of_prices_with_wide_outputs_and_375_rules_is_what_the_page_says():
    values = of("prices", "1 N", "three", column="delta_v_m_s")
    words = f"{trim_mean(values, 0.25):.2f} m/s ({{}}), {values.min():.2f} to {values.max():.2f}"
    assert re.search(re.escape(words).replace(r"\{\}", r"1\.\d+–1\.\d+"), PAGE)


def test_counts_and_differences_are_those_of_the_trainings():
    burnt = [int((of(penalty, column="delta_v_m_s") < 5.62).sum()) for penalty in ORDERS]
    seen = [int((of(penalty, column="inspected_percent") >= 95.0).sum()) for penalty in ORDERS]
    outside = [int((of(penalty, column="outside_percent") > 1.0).sum()) for penalty in ORDERS]
    assert burnt == [30, 29]
    assert f"only {seen[0]} and {seen[1]} of the 30" in PAGE
    assert f"And {outside[0]} and {outside[1]} of the 30" in PAGE
    strict = of("strict")
    head = PAGE.partition("| | the paper | 30 trainings")[2].partition("\n")[0]
    assert f"{len(of(*BESIDE[2]))} trainings, a strict order, 375 rules, outputs up to 1 N" in head
    for words, levels in CHANGES.items():
        arm = of(*levels)
        arm = {seed: row for seed, row in arm.items() if seed in strict}
        [row] = [line for line in PAGE.splitlines() if line.startswith(f"| {words}")]
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert int(cells[1]) == len(arm)
        columns = ("delta_v_m_s", "success_percent", "outside_percent")
        for cell, column, decimals in zip(cells[2:], columns, (2, 1, 1), strict=True):
            after = trim_mean([row[column] for row in arm.values()], 0.25)
            before = trim_mean([strict[seed][column] for seed in arm], 0.25)
            assert float(cell.split()[0]) == pytest.approx(after - before, abs=0.51 * 10.0**-decimals)
            # nine differences by the protocol, of which with 95 % none misses
            pairs = np.array([[row[column], strict[seed][column]] for seed, row in arm.items()])
            draws = np.random.default_rng(5).integers(len(pairs), size=(4000, len(pairs)))
            changes = np.subtract(*trim_mean(pairs[draws], 0.25, axis=1).T)
            low, high = (float(end) for end in re.findall(r"[+-]\d+\.\d+", cell)[1:])
            again = np.percentile(changes, [2.5 / 9.0, 100.0 - 2.5 / 9.0])
            np.testing.assert_allclose([low, high], again, atol=0.12 * np.ptp(again) + 10.0**-decimals)
