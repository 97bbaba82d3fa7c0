"""By how much statements change whole numbers: so counters of loops have a range."""

import ast
from collections.abc import Callable, Sequence

from pipeline.onboard.allowed import Range
from pipeline.onboard.statements import assigned_names


def growth(
    body: Sequence[ast.stmt],
    name: str,
    range_of_node: Callable[[ast.expr], Range],
    runs_of_loop: Callable[[ast.stmt], int | None],
) -> Range:
    """Return by how much statements lower and raise a name at most, stopped anywhere; None if not known.

    Parameters
    ----------
    body : sequence of ast.stmt
    name : str
    range_of_node : function of an expression
        What is added lies in this range.
    runs_of_loop : function of a loop
        How often its body runs at most; None if not known.
    """
    least = most = 0
    for statement in body:
        change = _change(statement, name, range_of_node, runs_of_loop)
        if change is None:
            return None
        least, most = least + min(0, change[0]), most + max(0, change[1])
    return least, most


def _change(
    statement: ast.stmt,
    name: str,
    range_of_node: Callable[[ast.expr], Range],
    runs_of_loop: Callable[[ast.stmt], int | None],
) -> Range:
    if name not in assigned_names([statement]):
        return 0, 0
    if isinstance(statement, ast.If):
        parts = [
            growth(part, name, range_of_node, runs_of_loop) for part in (statement.body, statement.orelse)
        ]
        known = [part for part in parts if part is not None]
        is_known = len(known) == len(parts)
        return (min(part[0] for part in known), max(part[1] for part in known)) if is_known else None
    if isinstance(statement, ast.For | ast.While):
        is_counter = isinstance(statement, ast.For) and any(
            isinstance(node, ast.Name) and node.id == name for node in ast.walk(statement.target)
        )
        runs, inner = runs_of_loop(statement), growth(statement.body, name, range_of_node, runs_of_loop)
        return None if is_counter or runs is None or inner is None else (runs * inner[0], runs * inner[1])
    added = _added(statement, name)
    if added is None:
        return None
    span = range_of_node(added[1])
    return span if span is None or added[0] else (-span[1], -span[0])


def _added(statement: ast.stmt, name: str) -> tuple[bool, ast.expr] | None:
    """Return whether a statement adds to a name or subtracts from it, and what; None if it does neither."""
    if isinstance(statement, ast.AugAssign) and isinstance(statement.target, ast.Name):
        operation, value = statement.op, statement.value
    elif (
        isinstance(statement, ast.Assign)
        and len(statement.targets) == 1
        and isinstance(statement.targets[0], ast.Name)
        and isinstance(statement.value, ast.BinOp)
        and isinstance(statement.value.left, ast.Name)
        and statement.value.left.id == name
    ):
        operation, value = statement.value.op, statement.value.right
    else:
        return None
    return (isinstance(operation, ast.Add), value) if isinstance(operation, ast.Add | ast.Sub) else None
