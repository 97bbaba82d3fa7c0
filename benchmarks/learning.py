"""Scores of learned fuzzy systems on scikit-learn's tables, with those of a linear model and a tree."""

import numpy as np
from sklearn.datasets import load_breast_cancer, load_diabetes, load_iris, load_wine
from sklearn.linear_model import LinearRegression, LogisticRegression
from sklearn.model_selection import RepeatedKFold, RepeatedStratifiedKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeClassifier, DecisionTreeRegressor

from benchmarks.timing import line
from fis_tools.learning import FuzzyClassifier, FuzzyRegressor

#: Five folds, with three different splits.
FOLDS = {"n_splits": 5, "n_repeats": 3, "random_state": 0}
NUMBERS = {
    "linear regression": LinearRegression(),
    "tree of depth 3": DecisionTreeRegressor(max_depth=3, random_state=0),
    "fuzzy, a number a rule, 2 terms": FuzzyRegressor(terms=2),
    "fuzzy, a number a rule, 3 terms": FuzzyRegressor(),
    "fuzzy, a line a rule, 2 terms": FuzzyRegressor("linear", terms=2),
    "fuzzy, sets (Wang and Mendel), not tuned": FuzzyRegressor("sets", tune=False),
}
CLASSES = {
    "logistic regression": make_pipeline(StandardScaler(), LogisticRegression()),
    "tree of depth 3": DecisionTreeClassifier(max_depth=3, random_state=0),
    "fuzzy, 2 terms": FuzzyClassifier(terms=2),
    "fuzzy, 3 terms": FuzzyClassifier(),
}
TABLES = {"iris": load_iris, "wine": load_wine, "breast cancer": load_breast_cancer}


def run() -> None:
    """Print the scores, averaged over the held-out folds."""
    X, y = load_diabetes(return_X_y=True)
    print("diabetes, explained variance (R²) and rules")
    for name, model in NUMBERS.items():
        _print(name, model, X, y, RepeatedKFold(**FOLDS))
    for title, load in TABLES.items():
        X, y = load(return_X_y=True)
        print(f"{title}, right answers and rules")
        for name, model in CLASSES.items():
            _print(name, model, X, y, RepeatedStratifiedKFold(**FOLDS))


def _print(name: str, model: object, X: np.ndarray, y: np.ndarray, folds: object) -> None:
    scores = cross_val_score(model, X, y, cv=folds)
    words = f"{scores.mean():.3f} ± {scores.std():.3f}"
    if hasattr(model, "tune"):
        words += f", {len(model.fit(X, y).system_.rules)}"
    line(name, words)
