"""Systems learned from tables with names, and what they reach on rows that they did not learn from."""

from typing import Any, NamedTuple

import numpy as np

from fis_tools.engines.compiler import compile
from fis_tools.learning.learner import Learned, Recipe, learn_classes, learn_number
from fis_tools.learning.partition import range_of
from fis_tools.learning.table import Column, Table, as_table, columns_over, distinct, name_and_unit
from fis_tools.model import FuzzySystem

#: Parts that a table is divided into: each is answered by what was learned from the others.
FOLDS = 5


class Reached(NamedTuple):
    """What a recipe reaches on rows that were not learned from.

    Attributes
    ----------
    error : float
        The root mean squared error, in the unit of the target; of classes the share of wrong ones.
    error_of_constant : float
        The same of one answer to everything: the mean, or the most frequent class.
    """

    error: float
    error_of_constant: float


def learn(content: Any, target: str, *, inputs: list[str] | None = None, **recipe: Any) -> FuzzySystem:
    """Learn a system from a table.

    Parameters
    ----------
    content : mapping, data frame or structured array
        Columns of numbers by their names, such as ``"petal length (cm)"``, whose unit is taken as such.
    target : str
        The column that is to be learned. Of words, the system has an output for each, its share.
    inputs : list of str, optional
        The columns that rules may ask for; by default all others.
    **recipe
        As `fis_tools.learning.Recipe` takes.

    Raises
    ------
    fis_tools.learning.table.UnreadableTable
        If nothing can be learned from the table; the text says why.
    """
    return learn_table(as_table(content, target, inputs), Recipe(**recipe)).system


def learn_table(table: Table, recipe: Recipe) -> Learned:
    """Learn a system, and tell which columns feed it."""
    columns = columns_over(table.rows, table.labels)
    name, unit = name_and_unit(table.target)
    if table.has_classes:
        classes, owner = np.unique(table.values, return_inverse=True)
        labels = distinct(name_and_unit(str(label))[0] for label in classes.tolist())
        return learn_classes(name, columns, table.rows, labels, np.eye(len(classes))[owner], recipe)
    target = Column(name, unit, *range_of(table.values))
    return learn_number(columns, table.rows, target, table.values, recipe)


def cross_validated(table: Table, recipe: Recipe) -> Reached | None:
    """Measure what a recipe reaches, every fifth row by what the others teach; None of too few rows."""
    fold = np.arange(len(table.values)) % FOLDS
    if len(table.values) < 2 * FOLDS:
        return None
    wrong, wrong_of_constant = 0.0, 0.0
    for left_out in range(FOLDS):
        kept, asked = fold != left_out, fold == left_out
        part = Table(table.labels, table.rows[kept], table.target, table.values[kept])
        learned = learn_table(part, recipe)
        answers = compile(learned.system)(np.ascontiguousarray(table.rows[asked][:, list(learned.columns)]))
        truth = table.values[asked]
        if table.has_classes:
            classes, counts = np.unique(part.values, return_counts=True)
            wrong += float((classes[answers.argmax(axis=1)] != truth).sum())
            wrong_of_constant += float((classes[counts.argmax()] != truth).sum())
        else:
            wrong += float(np.square(answers[:, 0] - truth).sum())
            wrong_of_constant += float(np.square(part.values.mean() - truth).sum())
    errors = np.array([wrong, wrong_of_constant]) / len(table.values)
    return Reached(*(errors if table.has_classes else np.sqrt(errors)).tolist())
