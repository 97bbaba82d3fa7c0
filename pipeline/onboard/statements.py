"""Python's early exits rewritten as branches, since C is written without jumps but for `break`."""

import ast
from collections.abc import Iterable, Sequence


def assigned_names(statements: Iterable[ast.stmt]) -> set[str]:
    """Return the names that statements bind, at any depth."""
    return {
        node.id
        for statement in statements
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }


def counted_by(body: Sequence[ast.stmt]) -> str:
    """Return the name that goes up by one at the end of a loop's body alone; "" for none."""
    *others, last = body
    if (
        isinstance(last, ast.AugAssign)
        and isinstance(last.op, ast.Add)
        and isinstance(last.target, ast.Name)
        and isinstance(last.value, ast.Constant)
        and last.value.value == 1
        and last.target.id not in assigned_names(others)
    ):
        return last.target.id
    return ""


def has_break(statements: Iterable[ast.stmt]) -> bool:
    """Return whether statements leave the loop around them."""
    return any(isinstance(node, ast.Break) for statement in statements for node in _in_this_loop(statement))


def _in_this_loop(statement: ast.stmt) -> Iterable[ast.AST]:
    yield statement
    if not isinstance(statement, ast.For | ast.While):
        for child in ast.iter_child_nodes(statement):
            if isinstance(child, ast.stmt):
                yield from _in_this_loop(child)


def _jumps(statement: ast.stmt, kind: type[ast.stmt]) -> bool:
    """Return whether a statement holds a return, at any depth, or a continue of this loop."""
    nodes = ast.walk(statement) if kind is ast.Return else _in_this_loop(statement)
    return any(isinstance(node, kind) for node in nodes)


def without_jumps(statements: Sequence[ast.stmt], kind: type[ast.stmt]) -> list[ast.stmt]:
    """Return statements that do the same, in which `return` or `continue` stands only at the end of a branch.

    What follows a branch with a jump moves into those branches that go on. A `continue`, and a `return`
    without a value, is left out where it stands at the end.
    """
    done: list[ast.stmt] = []
    for index, statement in enumerate(statements):
        if isinstance(statement, kind):
            if isinstance(statement, ast.Return) and statement.value is not None:
                done.append(statement)
            return done
        if isinstance(statement, ast.If) and _jumps(statement, kind):
            rest = statements[index + 1 :]
            body = without_jumps([*statement.body, *rest], kind)
            orelse = without_jumps([*statement.orelse, *rest], kind)
            branch = ast.If(statement.test, body or [ast.Pass()], orelse)
            return [*done, ast.fix_missing_locations(ast.copy_location(branch, statement))]
        done.append(statement)
    return done
