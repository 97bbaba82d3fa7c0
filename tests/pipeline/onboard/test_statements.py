"""Early exits rewritten as branches leave what a function does as it is."""

import ast
import inspect
import itertools
import textwrap

import pytest

from pipeline.onboard.statements import without_jumps


def continues(a, b, c):
    total = 0
    for i in range(5):
        if a and i == 1:
            if b:
                continue
            total += 10
        elif c:
            total += 100
            if i > 2:
                continue
        total += i
    return total


def returns(a, b, c):
    if a:
        if b:
            return 1
        result = 5
    else:
        result = 7
        if c:
            return result
    result += 1
    return result


def leaves_a_loop(a, b, c):
    total = 0
    for i in range(6):
        if a and i == 3:
            break
        for j in range(3):
            if b and j == 1:
                continue
            total += j
        if c:
            continue
        total += 100
    return total


class Rewriter(ast.NodeTransformer):
    def visit_FunctionDef(self, node):
        self.generic_visit(node)
        node.body = without_jumps(node.body, ast.Return)
        return node

    def visit_For(self, node):
        self.generic_visit(node)
        node.body = without_jumps(node.body, ast.Continue) or [ast.Pass()]
        return node


@pytest.mark.parametrize("function", [continues, returns, leaves_a_loop])
def test_it_does_the_same_without_jumps(function):
    tree = Rewriter().visit(ast.parse(textwrap.dedent(inspect.getsource(function))))
    assert not any(isinstance(node, ast.Continue) for node in ast.walk(tree))
    names = {}
    exec(compile(ast.fix_missing_locations(tree), "rewritten", "exec"), names)  # noqa: S102 - our own text
    for arguments in itertools.product([False, True], repeat=3):
        assert names[function.__name__](*arguments) == function(*arguments), arguments
