"""Fuzzy systems as estimators of scikit-learn: in pipelines, in searches, and open to a reader."""

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fis_tools.array_types import Floats
from fis_tools.engines.compiler import compile
from fis_tools.errors import MissingExtra
from fis_tools.learning.learner import Consequents, Learned, Recipe, learn_classes, learn_number
from fis_tools.learning.rules import range_of
from fis_tools.learning.table import Column, Samples, samples_of
from fis_tools.model import FuzzySystem
from plain_files.plain_text import distinct

try:
    from sklearn.base import BaseEstimator, ClassifierMixin, RegressorMixin
    from sklearn.utils import check_array
    from sklearn.utils.multiclass import check_classification_targets
    from sklearn.utils.validation import check_is_fitted, validate_data
except ModuleNotFoundError as missing:
    raise MissingExtra("an estimator", "scikit-learn", "scikit-learn") from missing


class _FuzzyEstimator(BaseEstimator):
    """Base of both estimators: a learned system, and the columns that feed it."""

    system_: FuzzySystem

    def _samples(self, rows: Floats, counts: Floats) -> Samples:
        labels = getattr(self, "feature_names_in_", [f"x{column}" for column in range(rows.shape[1])])
        return samples_of(rows, list(map(str, labels)), counts)

    def _keep(self, learned: Learned) -> Self:
        self.system_ = learned.system
        self.input_columns_ = np.array(learned.columns)
        return self

    def _infer(self, X: ArrayLike) -> Floats:
        """Return the learned system's outputs for rows of all features."""
        check_is_fitted(self)
        rows = validate_data(self, X, reset=False, dtype=np.float64)
        fed: Floats = np.ascontiguousarray(rows[:, self.input_columns_])
        return compile(self.system_)(fed)


def _counting(
    rows: Floats, values: NDArray[Any], sample_weight: ArrayLike | None
) -> tuple[Floats, NDArray[Any], Floats]:
    """Return the rows of positive weight, their targets, and their weights."""
    if sample_weight is None:
        return rows, values, np.ones(len(rows))
    weights: Floats = check_array(
        sample_weight, dtype=np.float64, ensure_2d=False, input_name="sample_weight"
    )
    if weights.shape != values.shape or (weights < 0.0).any() or np.count_nonzero(weights) < 2:
        raise ValueError(
            f"sample_weight has shape {weights.shape}; give a number for each of {len(rows)} rows, none "
            "below zero and two or more above it"
        )
    counts = weights > 0.0
    return rows[counts], values[counts], weights[counts]


class FuzzyRegressor(RegressorMixin, _FuzzyEstimator):
    """A number from the rules of a fuzzy system that is learned from a table.

    Parameters
    ----------
    consequents, terms, output_terms, max_inputs, tune
        See `fis_tools.learning.learner.Recipe`.

    Attributes
    ----------
    system_ : FuzzySystem
        What was learned. Nothing is drawn, so that the same table gives the same system.
    input_columns_ : (num_inputs,) int
        Which columns of a table are its inputs.
    """

    def __init__(
        self,
        consequents: Consequents = "constants",
        terms: int = 3,
        output_terms: int = 5,
        max_inputs: int = 3,
        tune: bool = True,
    ) -> None:
        self.consequents = consequents
        self.terms = terms
        self.output_terms = output_terms
        self.max_inputs = max_inputs
        self.tune = tune

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """Learn from a table, (n, num_features), and a number for each row, (n,).

        A row of weight two counts as two equal rows, one of weight zero is left out.
        """
        rows, values = validate_data(self, X, y, dtype=np.float64, y_numeric=True, ensure_min_samples=2)
        rows, values, counts = _counting(rows, np.asarray(values, dtype=np.float64), sample_weight)
        recipe = Recipe(**self.get_params())
        target = Column("y", "", *range_of(values))
        return self._keep(learn_number(self._samples(rows, counts), target, values, recipe))

    def predict(self, X: ArrayLike) -> Floats:
        """Return the number of each row, (n,)."""
        return self._infer(X)[:, 0]


class FuzzyClassifier(ClassifierMixin, _FuzzyEstimator):
    """A class from the rules of a fuzzy system that is learned from a table.

    The system has an output for each class: the share of the class among rows of such inputs.

    Parameters
    ----------
    terms, max_inputs, tune
        See `fis_tools.learning.learner.Recipe`.

    Attributes
    ----------
    system_ : FuzzySystem
        What was learned. Nothing is drawn, so that the same table gives the same system.
    classes_ : (num_classes,)
        In the order of the system's outputs.
    input_columns_ : (num_inputs,) int
        Which columns of a table are its inputs.
    """

    def __init__(self, terms: int = 3, max_inputs: int = 3, tune: bool = True) -> None:
        self.terms = terms
        self.max_inputs = max_inputs
        self.tune = tune

    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> Self:
        """Learn from a table, (n, num_features), and a class for each row, (n,).

        A row of weight two counts as two equal rows, one of weight zero is left out.
        """
        rows, labels = validate_data(self, X, y, dtype=np.float64, ensure_min_samples=2)
        check_classification_targets(labels)
        rows, labels, counts = _counting(rows, labels, sample_weight)
        self.classes_, class_indices = np.unique(labels, return_inverse=True)
        names = [label if isinstance(label, str) else f"class_{label}" for label in self.classes_.tolist()]
        owners = np.eye(len(names))[class_indices]
        recipe = Recipe(**self.get_params())
        samples = self._samples(rows, counts)
        return self._keep(learn_classes("y", samples, distinct(names), owners, recipe))

    def predict_proba(self, X: ArrayLike) -> Floats:
        """Return the share of each class for each row, (n, num_classes), with a sum of one."""
        shares = self._infer(X)
        total = shares.sum(axis=1, keepdims=True)
        prior = np.array([output.default for output in self.system_.outputs])
        shares = np.where(total > 0.0, shares, prior)
        return shares / shares.sum(axis=1, keepdims=True)

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Return the class of the greatest share of each row, (n,)."""
        shares = self.predict_proba(X)
        return self.classes_[shares.argmax(axis=1)]
