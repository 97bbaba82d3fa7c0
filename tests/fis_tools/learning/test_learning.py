"""Systems from tables: rules by hand, numbers by scikit-learn, partitions that stay readable."""

import math
import pickle

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet
from sklearn.base import clone
from sklearn.datasets import load_diabetes, load_iris
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

import fis_tools
from fis_tools.analysis.arrays import coverage, distinguishability
from fis_tools.engines.compiler import compile
from fis_tools.formats import serialize
from fis_tools.learning import FuzzyClassifier, FuzzyRegressor, Recipe, imitate, learn
from fis_tools.learning.learner import cross_validated, learn_table
from fis_tools.learning.rules import CLOSEST, Partition, even, fit, range_of, tuned, wang_mendel
from fis_tools.learning.table import UnreadableTable, as_table, read, read_csv
from fis_tools.model import FuzzyController, Is
from fis_tools.source import read_controller
from fis_tools.words.text import sentence
from tests.fis_tools.sample_controllers import EXAMPLES, SHIPPED, TIPPER
from tests.programs import run_python

IRIS = EXAMPLES / "iris.csv"


def test_wang_and_mendels_rules_are_those_by_hand():
    """Of four rows two contradict one another: their mean by degree is in the middle."""
    x, y = even(0.0, 10.0, 3), even(0.0, 100.0, 3)
    inputs = [(x.as_input(name, ""), x) for name in "ab"]
    rows = np.array([[0.0, 10.0], [4.0, 5.0], [5.0, 5.0], [10.0, 1.0]])
    values = np.array([100.0, 10.0, 90.0, 40.0])
    # degrees of rows 2 and 3: 0.8 * 1 * 0.8 = 0.64 and 1 * 1 * 0.8 = 0.8; mean (0.8 * 10 + 90) / 1.8 = 54.4
    learned = wang_mendel("s", inputs, (y.as_output("y", "", 60.0), y), rows, values, np.ones(len(rows)))
    assert [sentence(rule) for rule in learned.rules] == [
        "If a is low and b is high then y is high",
        "If a is medium and b is medium then y is medium",
        "If a is high and b is low then y is medium",
    ]


def test_numbers_that_rules_conclude_are_found_again():
    """A table over a full grid of terms is bilinear between peaks; without noise nothing is held back."""
    x = np.random.default_rng(0).uniform(0.0, 1.0, (400, 2))
    partitions = [Partition(0.0, 1.0, (0, 30, 100)), Partition(0.0, 1.0, (0, 60, 100))]
    truth = np.arange(9.0) ** 2
    weights = np.einsum("ni,nj->nij", *(p.memberships(c) for p, c in zip(partitions, x.T, strict=True)))
    fitted = fit(partitions, x, (weights.reshape(400, 9) @ truth)[:, np.newaxis], np.ones(400), "constants")
    np.testing.assert_allclose(fitted.coefficients[:, 0, 2], truth, atol=1e-5)
    lines = fit(partitions, x, (3.0 * x[:, :1] - x[:, 1:] + 2.0), np.ones(400), "linear")
    np.testing.assert_allclose(lines.coefficients[:, 0], np.tile([3.0, -1.0, 2.0], (9, 1)), atol=1e-9)


def test_classes_get_their_shares():
    """On the peaks a rule holds for its own rows alone, and concludes how many of them are of the class."""
    x = np.repeat([0.0, 1.0], [4, 6])[:, np.newaxis]
    owner = np.array([1, 1, 1, 0, 0, 0, 0, 0, 0, 1])
    fitted = fit([even(0.0, 1.0, 2)], x, np.eye(2)[owner], np.ones(len(x)), "shares")
    np.testing.assert_allclose(fitted.coefficients[:, :, 1], [[1 / 4, 3 / 4], [5 / 6, 1 / 6]])


def test_cross_validation_is_expected_rightly():
    """The expected error is near that on rows that were left out, measured by scikit-learn's own line."""
    content = load_diabetes()
    columns = dict(zip(content.feature_names, content.data.T, strict=True))
    table = as_table({**columns, "y": content.target}, "y")
    reached = cross_validated(table, Recipe(consequents="linear", terms=2))
    line = cross_val_predict(LinearRegression(), content.data, content.target)
    assert reached is not None
    assert reached.error < 1.05 * float(np.sqrt(np.mean((line - content.target) ** 2)))
    assert reached.error_of_constant == pytest.approx(content.target.std(), rel=0.01)


def test_the_most_frequent_class_is_that_of_all_rows():
    """The rows 0, 5 and 10 are answered by what the others teach, most of which are of the other class."""
    table = as_table({"x": list(range(11)), "y": list("abbbaabbaaa")}, "y")
    reached = cross_validated(table, Recipe(tune=False))
    assert reached is not None
    assert reached.error_of_constant == pytest.approx(5 / 11)


@pytest.mark.parametrize("terms", [2, 3, 7])
def test_what_is_tuned_stays_readable(terms):
    """Wherever an error pulls the peaks, terms stay in order, apart, distinguishable, and cover by a half."""
    pulled = tuned([even(-3.0, 5.0, terms)], lambda tried: float(np.abs(tried[0].peaks - 4.0).sum()))[0]
    for variable in (pulled.as_input("x", "m"), pulled.as_output("y", "m", 0.0)):
        similarity = distinguishability(variable).similarity
        assert np.max(similarity - np.eye(terms)) <= 1.0 / 3.0 + 1e-9
    assert coverage(pulled.as_input("x", "m")).least >= 0.5 - 1e-12
    assert np.diff(pulled.positions).min() >= CLOSEST
    if terms > 2:
        assert pulled.positions != even(-3.0, 5.0, terms).positions


def test_an_output_of_sets_reaches_its_ends():
    """A lone outer term has its centre at the end of the range."""
    y = Partition(10.0, 20.0, (0, 20, 100))
    x = even(0.0, 1.0, 2)
    rows, values = np.array([[0.0], [1.0]]), np.array([10.0, 20.0])
    inputs = [(x.as_input("x", ""), x)]
    output = (y.as_output("y", "", 15.0), y)
    system = wang_mendel("s", inputs, output, rows, values, np.ones(2))
    np.testing.assert_allclose(compile(system)(rows)[:, 0], values, atol=1e-9)


def test_ranges_are_round_and_never_empty():
    assert range_of(np.array([4.31, 7.88])) == (4.3, 7.9)
    assert range_of(np.array([-181.0, 944.0])) == (-200.0, 1000.0)
    assert range_of(np.array([3.0, 3.0])) == (1.5, 4.5)
    low, high = range_of(np.array([1e300, 1.1e300]))
    assert low <= 1e300
    assert high >= 1.1e300


def test_words_are_classes_and_names_have_units():
    system = learn(read_csv(IRIS), "species")
    assert [(v.name, v.unit) for v in system.inputs] == [("petal_length", "cm"), ("petal_width", "cm")]
    assert [v.name for v in system.outputs] == ["setosa", "versicolor", "virginica"]
    table = as_table(read_csv(IRIS), "species")
    answers = compile(system)(table.rows[:, [2, 3]])
    right = np.array(["setosa", "versicolor", "virginica"])[answers.argmax(axis=1)] == table.values
    assert right.mean() > 0.95
    assert learn_table(table, Recipe()).system == system


def test_names_never_clash():
    x = np.linspace(0.0, 1.0, 20)
    for consequents in ("constants", "sets"):
        system = learn({"y (m)": x, "y": 2 * x}, "y", consequents=consequents, tune=False)
        assert [system.inputs[0].name, system.outputs[0].name] == ["y", "y_2"]
        assert isinstance(system.rules[0].antecedent, Is)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a,y\n1,2\n3\n", "line 3 has 1 cells, but line 1 names 2 columns"),
        ("a,y\n1,2\nred,3\n", "column 'a' has red in row 2, which is no finite number"),
        ("a,y\n1,nan\n2,3\n", "column 'y' has nan in row 1"),
        ("a,a\n1,2\n", "two columns have one name"),
        ("a,z\n1,2\n3,4\n", "no column 'y'; choose one of a, z"),
        ("y\n1\n2\n", "no column besides 'y'"),
        ("a,y\n1,2\n", "fewer than two rows"),
        ("", "one has none"),
    ],
)
def test_a_table_that_is_none_is_told(text, sentence, tmp_path, refused):
    path = tmp_path / "table.csv"
    path.write_text(text, encoding="utf-8")
    assert sentence in refused("learn", path, "--target", "y")


def test_the_command_writes_a_controller(tmp_path, run, refused):
    path = tmp_path / "iris.json"
    table = read_csv(IRIS)
    words = ("learn", IRIS, "--target", "species")
    printed = run(*words, "-o", path).out
    assert "5 rules of petal_length (cm), petal_width (cm)" in printed
    assert "always setosa: 33.3%" in printed
    assert serialize.load(path).systems == (learn(table, "species"),)
    assert "terms is 9; give a whole number from 2 to 7" in refused(*words, "--terms", "9")
    refused("learn", tmp_path / "none.csv", "--target", "y")
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
    for note, start in zip(table.notes, ("column 'word' ", "column 'same' ", "2 of "), strict=True):
        assert note.startswith(start)
    with pytest.raises(UnreadableTable, match="'word' has r in row 1"):
        as_table(whole | others, "y", ["a", "word"])


def test_a_column_with_a_unit_goes_by_its_name_where_no_other_does():
    content = {
        "air speed (m/s)": [1, 2, 3],
        "b (m)": [1, 2, 4],
        "b (s)": [1, 3, 2],
        "b": [3, 2, 1],
        "y (N)": [2, 4, 6],
    }
    table = as_table(content, "y", ["air speed", "b"])
    assert (table.labels, table.target) == (("air speed (m/s)", "b"), "y (N)")
    del content["b"]
    for inputs in (["b"], ["air speed (km/h)"]):
        with pytest.raises(UnreadableTable, match="the table has no column"):
            as_table(content, "y", inputs)


#: what only runs with pandas, or with a setting of scipy
ELSEWHERE = {
    "check_array_api_input",
    "check_classifier_data_not_an_array",
    "check_regressor_data_not_an_array",
    "check_sample_weights_pandas_series",
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "estimator",
    [
        FuzzyRegressor(),
        FuzzyRegressor("linear", terms=2),
        FuzzyRegressor("sets", tune=False),
        FuzzyClassifier(),
    ],
    ids=str,
)
def test_scikit_learns_own_checks_pass(estimator):
    results = check_estimator(estimator, on_skip=None)
    assert len(results) > 40
    assert {r["check_name"] for r in results if r["status"] != "passed"} <= ELSEWHERE


def test_pipelines_and_searches_take_them():
    X, y = load_iris(return_X_y=True)
    steps = make_pipeline(StandardScaler(), FuzzyClassifier())
    choices = {"fuzzyclassifier__terms": [2, 3], "fuzzyclassifier__max_inputs": [1, 2]}
    search = GridSearchCV(steps, choices, cv=3).fit(X, y)
    assert search.best_score_ > 0.93
    best = search.best_estimator_[-1]
    assert search.best_params_["fuzzyclassifier__terms"] == len(best.system_.inputs[0].terms)
    shares = search.predict_proba(X)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(search)).predict(X), shares.argmax(axis=1))  # noqa: S301


def bumps(count: int = 300) -> tuple[np.ndarray, np.ndarray]:
    """A table of which the third column does not matter."""
    X = np.random.default_rng(1).uniform(-1.0, 1.0, (count, 3))
    return X, np.cos(2.0 * X[:, 0]) + X[:, 1]


@pytest.mark.parametrize("consequents", ["constants", pytest.param("linear", marks=pytest.mark.slow), "sets"])
def test_all_that_takes_a_system_takes_what_they_learned(consequents, tmp_path):
    X, y = bumps()
    model = FuzzyRegressor(consequents, 5, 7, max_inputs=2, tune=consequents != "sets").fit(X, y)
    assert model.input_columns_.tolist() == [0, 1]
    assert model.score(X, y) > 0.9
    system = model.system_
    np.testing.assert_array_equal(fis_tools.compile(system)(X[:, :2])[:, 0], model.predict(X))
    assert isinstance(fis_tools.audit(system).findings, tuple | list)
    explained = fis_tools.explain(system, {"x0": 0.2, "x1": -0.4})
    assert explained.outputs[0].value == pytest.approx(model.predict([[0.2, -0.4, 9.0]])[0], abs=1e-9)
    controller = FuzzyController("learned", (system,))
    assert serialize.loads(serialize.dump_json(controller), "json") == controller
    assert "double infer_" in fis_tools.export_c(system, tmp_path / "learned.c").read_text(encoding="utf-8")
    if consequents == "sets":
        page = fis_tools.review(system, tmp_path / "page.html")
        assert "If x0 is" in page.read_text(encoding="utf-8") or page.stat().st_size > 100_000


def test_the_same_table_gives_the_same_system():
    X, y = bumps(60)
    assert FuzzyRegressor().fit(X, y).system_ == FuzzyRegressor().fit(X, y).system_
    with pytest.raises(ValueError, match="consequents is 'planes'; use one of sets, constants, linear"):
        FuzzyRegressor("planes").fit(X, y)


def test_without_scikit_learn_a_sentence_says_what_to_install():
    code = "import sys; sys.modules['sklearn'] = None\nimport fis_tools.learning as learning\n"
    code += "try:\n    learning.FuzzyRegressor\nexcept ImportError as error:\n    print(error)"
    cure = "which is not installed; install it: python -m pip install scikit-learn"
    assert run_python("-c", code).stdout == f"an estimator needs scikit-learn, {cure}\n"


@pytest.mark.parametrize(
    "estimator",
    [
        FuzzyRegressor(),
        pytest.param(FuzzyRegressor("linear"), marks=pytest.mark.slow),
        FuzzyRegressor("sets"),
        FuzzyClassifier(),
    ],
    ids=str,
)
def test_a_row_of_weight_two_counts_as_two_rows(estimator):
    X, y = bumps(60)
    y = y if isinstance(estimator, FuzzyRegressor) else np.where(y > 0.5, "high", "low")
    X[7] = 40.0  # of weight zero: no range reaches it
    weights = np.arange(60) % 3
    weights[7] = 0
    weighted = clone(estimator).fit(X, y, sample_weight=weights)
    repeated = clone(estimator).fit(np.repeat(X, weights, axis=0), np.repeat(y, weights))
    assert weighted.system_.inputs == repeated.system_.inputs
    assert weighted.system_ != clone(estimator).fit(X, y).system_
    answer = "predict_proba" if isinstance(estimator, FuzzyClassifier) else "predict"
    answers, expected = (getattr(estimator, answer)(X) for estimator in (weighted, repeated))
    np.testing.assert_allclose(
        answers, expected, atol=0.01
    )  # sums in another order may round to another digit


def test_weights_that_count_nothing_are_refused():
    X, y = bumps(4)
    for weights in ([1.0, 1.0], [1.0, -1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]):
        with pytest.raises(ValueError, match="each of 4 rows"):
            FuzzyRegressor().fit(X, y, sample_weight=weights)


def plane(position, velocity):
    return -2.0 * position - 0.5 * velocity


RANGES = {"position (m)": (-1.0, 1.0), "velocity (m/s)": (-2.0, 2.0)}


def test_a_plane_is_imitated_to_the_digits_that_are_kept():
    """A line is a sum of tents: every kind of number says it, up to rounding to a thousandth."""
    for consequents in ("constants", "linear"):
        learned = imitate(plane, RANGES, output="force", consequents=consequents)
        assert [(v.name, v.unit) for v in learned.system.inputs] == [("position", "m"), ("velocity", "m/s")]
        assert learned.system.outputs[0].name == "force"
        assert learned.largest < 0.01 * 6.0
        at = np.array([[0.3, -1.1]])
        assert compile(learned.system)(at)[0, 0] == pytest.approx(-0.05, abs=learned.largest)


def test_the_error_told_is_that_on_other_samples():
    learned = imitate(lambda a: np.sin(3.0 * a), {"a": (-1.0, 1.0)}, terms=7, num_samples=500)
    a = np.linspace(-1.0, 1.0, 4001)
    miss = compile(learned.system)({"a": a})["output"] - np.sin(3.0 * a)
    assert learned.root_mean_square == pytest.approx(np.sqrt(np.mean(miss**2)), rel=0.1)
    assert learned.largest == pytest.approx(np.abs(miss).max(), rel=0.2)
    assert learned.largest < 0.15


def test_more_terms_imitate_a_fuzzy_system_better():
    coarse, fine = (imitate(TIPPER, terms=terms, num_samples=600, tune=False) for terms in (2, 5))
    assert fine.root_mean_square < 0.75 * coarse.root_mean_square
    names = [v.name for v in read_controller(TIPPER).systems[0].inputs]
    assert [v.name for v in fine.system.inputs] == names
    assert fine.system.outputs[0].name == "tip"
    assert imitate(TIPPER, terms=2, num_samples=600, tune=False).system == coarse.system


@pytest.mark.parametrize(
    ("function", "ranges", "sentence"),
    [
        (np.sin, None, "a function does not say its inputs"),
        (np.sin, {"a": (1.0, 1.0)}, "give two finite numbers that ascend"),
        (lambda a: 1.0, {"a": (0.0, 1.0)}, "pass numpy.vectorize"),
        (lambda a: np.where(a > 0.5, np.nan, a), {"a": (0.0, 1.0)}, "returns no finite number at"),
        (TIPPER, {"a": (0.0, 1.0)}, "pass those of service, food"),
        (SHIPPED["paper_champion"], None, "there are several outputs"),
    ],
)
def test_what_cannot_be_imitated_is_told(function, ranges, sentence):
    with pytest.raises(ValueError, match=sentence):
        imitate(function, ranges)


def test_more_rules_than_anybody_reads_are_refused():
    ranges = dict.fromkeys("abcdef", (0.0, 1.0))
    with pytest.raises(ValueError, match="5 terms of 6 inputs are up to 15,625 rules"):
        imitate(lambda *columns: sum(columns), ranges, terms=5, max_inputs=6)
