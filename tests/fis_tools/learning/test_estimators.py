"""The estimators are scikit-learn's, and what they learn is an ordinary system."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.datasets import load_iris
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

import fis_tools
from fis_tools.formats import serialize
from fis_tools.learning import FuzzyClassifier, FuzzyRegressor
from fis_tools.model import FuzzyController
from tests.places import PROJECT

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
    search = GridSearchCV(
        steps, {"fuzzyclassifier__terms": [2, 3], "fuzzyclassifier__max_inputs": [1, 2]}, cv=3
    )
    search.fit(X, y)
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


@pytest.mark.parametrize("consequents", ["constants", "linear", "sets"])
def test_all_that_takes_a_system_takes_what_they_learned(consequents: str, tmp_path: Path) -> None:
    X, y = bumps()
    model = FuzzyRegressor(consequents, 5, 7, max_inputs=2, tune=consequents != "sets").fit(X, y)
    assert model.input_columns_.tolist() == [0, 1]
    assert model.score(X, y) > 0.9
    system = model.system_
    np.testing.assert_array_equal(fis_tools.compile(system)(X[:, :2])[:, 0], model.predict(X))
    assert isinstance(fis_tools.audit(system).findings, tuple | list)
    told = fis_tools.explain(system, {"x0": 0.2, "x1": -0.4})
    assert told.outputs[0].value == pytest.approx(model.predict([[0.2, -0.4, 9.0]])[0], abs=1e-9)
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
    code = (
        "import sys; sys.modules['sklearn'] = None\n"
        "import fis_tools.learning as learning\n"
        "try:\n    learning.FuzzyRegressor\nexcept ImportError as error:\n    print(error)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=PROJECT, capture_output=True, text=True, check=True)  # noqa: S603
    assert done.stdout == (
        "an estimator needs scikit-learn, which is not installed; install it: "
        "python -m pip install scikit-learn\n"
    )


@pytest.mark.parametrize(
    "estimator",
    [FuzzyRegressor(), FuzzyRegressor("linear"), FuzzyRegressor("sets"), FuzzyClassifier()],
    ids=str,
)
def test_a_row_of_weight_two_counts_as_two_rows(estimator):
    X, y = bumps(120)
    y = y if isinstance(estimator, FuzzyRegressor) else np.where(y > 0.5, "high", "low")
    X[7] = 40.0  # of weight zero: no range reaches it
    weights = np.arange(120) % 3
    weights[7] = 0
    weighted = clone(estimator).fit(X, y, sample_weight=weights)
    repeated = clone(estimator).fit(np.repeat(X, weights, axis=0), np.repeat(y, weights))
    assert weighted.system_.inputs == repeated.system_.inputs
    assert weighted.system_ != clone(estimator).fit(X, y).system_
    answer = "predict_proba" if isinstance(estimator, FuzzyClassifier) else "predict"
    told, expected = (getattr(one, answer)(X) for one in (weighted, repeated))
    np.testing.assert_allclose(told, expected, atol=0.01)  # sums in another order may round to another digit


def test_weights_that_count_nothing_are_refused():
    X, y = bumps(4)
    for weights in ([1.0, 1.0], [1.0, -1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 1.0]):
        with pytest.raises(ValueError, match="each of 4 rows"):
            FuzzyRegressor().fit(X, y, sample_weight=weights)
