"""A function without what is known of it: numbers are filled in, branches taken, idle variables left out."""

import ast
from collections.abc import Iterator, Mapping, Sequence
from types import ModuleType
from typing import Any


class NotTranscribed(Exception):  # noqa: N818 - it is said of a statement
    """A statement or an expression that is not transcribed."""

    def __init__(self, node: ast.AST) -> None:
        super().__init__(f"is not transcribed: {ast.unparse(node)}")


def resolved(node: ast.expr, known: Mapping[str, Any]) -> Any:
    """Return what a name, or an attribute of a module, stands for; None if it is not known."""
    match node:
        case ast.Name(name):
            return known.get(name)
        case ast.Attribute(value, name):
            module = resolved(value, known)
            return getattr(module, name) if isinstance(module, ModuleType) else None
    return None


def walk(body: Sequence[ast.AST]) -> Iterator[ast.AST]:
    """Yield the nodes of statements in their order."""
    waiting: list[ast.AST] = list(reversed(body))
    while waiting:
        node = waiting.pop()
        yield node
        waiting += reversed([*ast.iter_child_nodes(node)])


def names_in(body: Sequence[ast.AST], context: type[ast.expr_context] = ast.expr_context) -> set[str]:
    """Return the names in statements, those that are read or set."""
    return {n.id for n in walk(body) if isinstance(n, ast.Name) and isinstance(n.ctx, context)}


def folded(body: Sequence[ast.stmt], known: Mapping[str, Any], renamed: Mapping[str, str]) -> list[ast.stmt]:
    """Return the statements that are left of a function.

    Parameters
    ----------
    body : sequence of ast.stmt
    known : mapping
        What names stand for; numbers are filled in.
    renamed : mapping of str to str
        Names of variables, and what they become.

    Returns
    -------
    list of ast.stmt
        Assignments have one target each.
    """
    return _pruned(_ended(_Folded(known, renamed).block(body)))


class _Folded(ast.NodeTransformer):
    """Fills in numbers that are known, takes branches that these decide, and splits assignments."""

    def __init__(self, known: Mapping[str, Any], renamed: Mapping[str, str]) -> None:
        self.known, self.renamed = known, renamed

    def block(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Return the statements that are left."""
        kept: list[ast.stmt] = []
        for statement in statements:
            new = self.visit(statement)
            kept += new if isinstance(new, list) else [new] * (new is not None)
        return kept

    def _number(self, node: ast.expr) -> ast.expr:
        value = resolved(node, self.known)
        return ast.Constant(value) if isinstance(value, int | float) else node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self._number(ast.Name(self.renamed.get(node.id, node.id), node.ctx))

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        return self._number(node)

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        match node:
            case ast.Compare(ast.Constant(left), [ast.Eq()], [ast.Constant(right)]):
                return ast.Constant(left == right)
        return node

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.expr:
        self.generic_visit(node)
        decisive = isinstance(node.op, ast.Or)
        answers = [value.value for value in node.values if isinstance(value, ast.Constant)]
        node.values = [value for value in node.values if not isinstance(value, ast.Constant)]
        if decisive in answers or not node.values:
            return ast.Constant(decisive if decisive in answers else not decisive)
        return node if len(node.values) > 1 else node.values[0]

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.test, ast.Constant):
            return node.body if node.test.value else node.orelse
        return node

    def visit_If(self, node: ast.If) -> ast.stmt | list[ast.stmt]:
        node.test = self.visit(node.test)
        node.body, node.orelse = self.block(node.body), self.block(node.orelse)
        if isinstance(node.test, ast.Constant):
            return node.body if node.test.value else node.orelse
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Leave a declaration out: kinds are found."""
        if node.value is not None:
            raise NotTranscribed(node)

    def visit_Expr(self, node: ast.Expr) -> ast.stmt | None:
        self.generic_visit(node)
        return None if isinstance(node.value, ast.Constant) else node

    def visit_Assign(self, node: ast.Assign) -> list[ast.stmt]:
        self.generic_visit(node)
        match node:
            case ast.Assign([ast.Tuple(targets)], ast.Tuple(values)):
                for index, target in enumerate(targets):
                    for later in values[index + 1 :]:
                        if {n.id for n in ast.walk(later) if isinstance(n, ast.Name)} & _set_by(target):
                            raise NotTranscribed(node)
                pairs = zip(targets, values, strict=True)
                return [ast.Assign([target], value, lineno=node.lineno) for target, value in pairs]
            case ast.Assign([ast.Name() | ast.Subscript()], _):
                return [node]
        raise NotTranscribed(node)


def _set_by(target: ast.expr) -> set[str]:
    """Return the variable or the array that an assignment changes."""
    name = target.value if isinstance(target, ast.Subscript) else target
    return {name.id} if isinstance(name, ast.Name) else set()


def _ended(body: list[ast.stmt]) -> list[ast.stmt]:
    """Leave out what stands behind a statement that ends its block."""
    kept = []
    for statement in body:
        for part in ("body", "orelse"):
            if hasattr(statement, part):
                setattr(statement, part, _ended(getattr(statement, part)))
        kept.append(statement)
        if isinstance(statement, ast.Return | ast.Continue | ast.Break):
            break
    return kept


def _pruned(body: list[ast.stmt]) -> list[ast.stmt]:
    """Leave out assignments to variables on which nothing depends, and choices that are empty then."""
    settings, needed = [], set[str]()
    waiting: list[ast.AST] = list(body)
    while waiting:
        match node := waiting.pop():
            case ast.Assign([ast.Name(name)], value) | ast.AugAssign(ast.Name(name), _, value):
                settings.append((name, names_in([value])))
            case ast.Name(name):
                needed.add(name)
            case _:
                waiting += ast.iter_child_nodes(node)
    for _ in settings:
        needed |= {name for target, names in settings if target in needed for name in names}

    def is_needed(statement: ast.stmt) -> bool:
        match statement:
            case ast.Assign([ast.Name(name)]) | ast.AugAssign(ast.Name(name)):
                return name in needed
            case ast.If(_, [], []):
                return False
        return True

    def kept(statements: list[ast.stmt]) -> list[ast.stmt]:
        for statement in statements:
            for part in ("body", "orelse"):
                if hasattr(statement, part):
                    setattr(statement, part, kept(getattr(statement, part)))
        match left := [statement for statement in statements if is_needed(statement)]:
            case [*before, ast.Assign([ast.Name(name)], value), ast.Return(ast.Name(returned))] if (
                name == returned
            ):
                return [*before, ast.Return(value)]
        return left

    return kept(body)
