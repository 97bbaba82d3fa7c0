"""Systems from tables: rules by hand, numbers by scikit-learn, partitions that stay readable."""

import math
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet
from sklearn.datasets import load_diabetes
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import cross_val_predict

from fis_tools.__main__ import main
from fis_tools.analysis.arrays import coverage, distinguishability
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.learning import Recipe, learn
from fis_tools.learning.learner import cross_validated, learn_table
from fis_tools.learning.rules import CLOSEST, Partition, even, fit, range_of, tuned, wang_mendel
from fis_tools.learning.table import UnreadableTable, as_table, read, read_csv
from fis_tools.model import Is
from fis_tools.words.text import sentence
from tests.places import PROJECT

IRIS = PROJECT / "docs" / "examples" / "iris.csv"


def test_wang_and_mendels_rules_are_those_by_hand() -> None:
    """Of four rows two contradict one another: their mean by degree is in the middle."""
    x, y = even(0.0, 10.0, 3), even(0.0, 100.0, 3)
    inputs = [(x.as_input("a", ""), x), (x.as_input("b", ""), x)]
    rows = np.array([[0.0, 10.0], [4.0, 5.0], [5.0, 5.0], [10.0, 1.0]])
    values = np.array([100.0, 10.0, 90.0, 40.0])
    # degrees of rows 2 and 3: 0.8 * 1 * 0.8 = 0.64 and 1 * 1 * 0.8 = 0.8; mean (0.8 * 10 + 90) / 1.8 = 54.4
    learned = wang_mendel("s", inputs, (y.as_output("y", "", 60.0), y), rows, values, np.ones(len(rows)))
    assert [sentence(rule) for rule in learned.rules] == [
        "If a is low and b is high then y is high",
        "If a is medium and b is medium then y is medium",
        "If a is high and b is low then y is medium",
    ]


def test_numbers_that_rules_conclude_are_found_again() -> None:
    """A table over a full grid of terms is bilinear between peaks; without noise nothing is held back."""
    x = np.random.default_rng(0).uniform(0.0, 1.0, (400, 2))
    partitions = [Partition(0.0, 1.0, (0, 30, 100)), Partition(0.0, 1.0, (0, 60, 100))]
    truth = np.arange(9.0) ** 2
    weights = np.einsum("ni,nj->nij", *(p.memberships(c) for p, c in zip(partitions, x.T, strict=True)))
    found = fit(partitions, x, (weights.reshape(400, 9) @ truth)[:, np.newaxis], np.ones(400), "constants")
    np.testing.assert_allclose(found.coefficients[:, 0, 2], truth, atol=1e-5)
    lines = fit(partitions, x, (3.0 * x[:, :1] - x[:, 1:] + 2.0), np.ones(400), "linear")
    np.testing.assert_allclose(lines.coefficients[:, 0], np.tile([3.0, -1.0, 2.0], (9, 1)), atol=1e-9)


def test_classes_get_their_shares() -> None:
    """On the peaks a rule holds for its own rows alone, and concludes how many of them are of the class."""
    x = np.repeat([0.0, 1.0], [4, 6])[:, np.newaxis]
    owner = np.array([1, 1, 1, 0, 0, 0, 0, 0, 0, 1])
    found = fit([even(0.0, 1.0, 2)], x, np.eye(2)[owner], np.ones(len(x)), "shares")
    np.testing.assert_allclose(found.coefficients[:, :, 1], [[1 / 4, 3 / 4], [5 / 6, 1 / 6]])


def test_cross_validation_is_expected_rightly() -> None:
    """The expected error is near that on rows that were left out, measured by scikit-learn's own line."""
    content = load_diabetes()
    columns = dict(zip(content.feature_names, content.data.T, strict=True))
    table = as_table({**columns, "y": content.target}, "y")
    reached = cross_validated(table, Recipe(consequents="linear", terms=2))
    line = cross_val_predict(LinearRegression(), content.data, content.target)
    assert reached is not None
    assert reached.error < 1.05 * float(np.sqrt(np.mean((line - content.target) ** 2)))
    assert reached.error_of_constant == pytest.approx(content.target.std(), rel=0.01)


@pytest.mark.parametrize("terms", [2, 3, 7])
def test_what_is_tuned_stays_readable(terms: int) -> None:
    """Wherever an error pulls the peaks, terms stay in order, apart, distinguishable, and cover by a half."""
    pulled = tuned([even(-3.0, 5.0, terms)], lambda tried: float(np.abs(tried[0].peaks - 4.0).sum()))[0]
    for variable in (pulled.as_input("x", "m"), pulled.as_output("y", "m", 0.0)):
        similarity = distinguishability(variable).similarity
        assert np.max(similarity - np.eye(terms)) <= 1.0 / 3.0 + 1e-9
    assert coverage(pulled.as_input("x", "m")).least >= 0.5 - 1e-12
    assert np.diff(pulled.places).min() >= CLOSEST
    if terms > 2:
        assert pulled.places != even(-3.0, 5.0, terms).places


def test_an_output_of_sets_reaches_its_ends() -> None:
    """A lone outer term has its centre at the end of the range."""
    y = Partition(10.0, 20.0, (0, 20, 100))
    x = even(0.0, 1.0, 2)
    rows, values = np.array([[0.0], [1.0]]), np.array([10.0, 20.0])
    system = wang_mendel(
        "s", [(x.as_input("x", ""), x)], (y.as_output("y", "", 15.0), y), rows, values, np.ones(len(rows))
    )
    np.testing.assert_allclose(compile(system)(rows)[:, 0], values, atol=1e-9)


def test_ranges_are_round_and_never_empty() -> None:
    assert range_of(np.array([4.31, 7.88])) == (4.3, 7.9)
    assert range_of(np.array([-181.0, 944.0])) == (-200.0, 1000.0)
    assert range_of(np.array([3.0, 3.0])) == (1.5, 4.5)
    values = np.array([1e300, 1.1e300])
    low, high = range_of(values)
    assert low <= values[0]
    assert values[1] <= high


def test_words_are_classes_and_names_have_units() -> None:
    system = learn(read_csv(IRIS), "species")
    assert [(v.name, v.unit) for v in system.inputs] == [("petal_length", "cm"), ("petal_width", "cm")]
    assert [v.name for v in system.outputs] == ["setosa", "versicolor", "virginica"]
    table = as_table(read_csv(IRIS), "species")
    answers = compile(system)(table.rows[:, [2, 3]])
    right = np.array(["setosa", "versicolor", "virginica"])[answers.argmax(axis=1)] == table.values
    assert right.mean() > 0.95
    assert learn_table(table, Recipe()).system == system


def test_names_never_clash() -> None:
    x = np.linspace(0.0, 1.0, 20)
    for consequents in ("constants", "sets"):
        system = learn({"y (m)": x, "y": 2 * x}, "y", consequents=consequents, tune=False)
        assert [system.inputs[0].name, system.outputs[0].name] == ["y", "y_2"]
        assert isinstance(system.rules[0].antecedent, Is)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a,y\n1,2\n3\n", "line 3 has 1 cells, but line 1 names 2 columns"),
        ("a,y\n1,2\nred,3\n", "column 'a' has red in row 2, which is no finite number"),
        ("a,y\n1,nan\n2,3\n", "column 'y' has nan in row 1"),
        ("a,a\n1,2\n", "two columns have one name"),
        ("a,z\n1,2\n3,4\n", "no column 'y'; did you mean"),
        ("y\n1\n2\n", "no column besides 'y'"),
        ("a,y\n1,2\n", "fewer than two rows"),
        ("", "one has none"),
    ],
)
def test_a_table_that_is_none_is_told(
    text: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    told = told.replace("did you mean", "choose one of a, z")
    assert main(["learn", str(path), "--target", "y"]) == 2
    assert told in capsys.readouterr().err


def test_the_command_writes_a_controller(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "iris.json"
    assert main(["learn", str(IRIS), "--target", "species", "-o", str(path)]) == 0
    told = capsys.readouterr().out
    assert "5 rules of petal_length (cm), petal_width (cm)" in told
    assert "always setosa: 33.3%" in told
    assert serialize.load(path).systems == (learn(read_csv(IRIS), "species"),)
    assert main(["learn", str(IRIS), "--target", "species", "--terms", "9"]) == 2
    assert "terms is 9; give a whole number from 2 to 7" in capsys.readouterr().err
    assert main(["learn", str(tmp_path / "none.csv"), "--target", "y"]) == 2
    table = read_csv(IRIS)
    columns = {name: table[name] if name == "species" else list(map(float, table[name])) for name in table}
    parquet.write_table(pyarrow.table(columns), tmp_path / "iris.parquet")
    assert learn(read(tmp_path / "iris.parquet"), "species") == learn(table, "species")
    with pytest.raises(UnreadableTable, match="pass a mapping"):
        as_table(np.ones((3, 2)), "y")


def test_gaps_words_and_constants_are_left_out_and_told():
    whole = {"a": [1, 2, 3, 4, 5, 6], "y": [2, 4, 6, 8, 10, 12]}
    others = {"word": list("rgbrgb"), "same": [7] * 6, "gap": [0.1, None, 0.5, math.nan, 0.2, 0.3]}
    table = as_table(whole | others, "y")
    assert table.labels == ("a", "gap")
    np.testing.assert_array_equal(table.rows, [[1, 0.1], [3, 0.5], [5, 0.2], [6, 0.3]])
    np.testing.assert_array_equal(table.values, [2, 6, 10, 12])
    assert [note.split(" ")[:2] for note in table.notes] == [
        ["column", "'word'"],
        ["column", "'same'"],
        ["2", "of"],
    ]
    with pytest.raises(UnreadableTable, match="'word' has r in row 1"):
        as_table(whole | others, "y", ["a", "word"])
