"""Functions of `fis_tools.formats.c.transcribed.functions`, written as C99.

Operations stand in the order of the Python, so that each rounds as there; C needs ``-ffp-contract=off`` where
a processor would fuse some.
"""

import ast
import math
import re
from collections.abc import Iterator, Mapping, Sequence

from fis_tools.formats.c.text import broken, comment, exact
from fis_tools.formats.c.transcribed.folding import NotTranscribed
from fis_tools.formats.c.transcribed.functions import ScalarFunction

_BINARY = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//"}
_COMPARE = {ast.Eq: "==", ast.NotEq: "!=", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
#: functions of NumPy that both languages call otherwise; others are called as in `math`
_CALLED = {"power": "pow", "abs": "fabs", "min": "fmin", "max": "fmax"}


#: stands between the words of a parameter until lines are broken
NO_BREAK = "\u00a0"


class C:
    """How a function is written in C99."""

    def text(self, function: ScalarFunction) -> str:
        """Return a function as text."""
        self.function = function
        lines = [*self.opening(), "{", *self.block(function.body, 1), "}"]
        text = "\n".join(part for line in lines for part in broken(line)) + "\n"
        return text.replace(NO_BREAK, " ")

    def opening(self) -> list[str]:
        """Return the comment and the head."""
        function = self.function
        parameters = []
        for name in function.parameters:
            axes = function.arrays.get(name, 0)
            const = "const " if axes and name not in function.written else ""
            parameters.append(f"{const}{self.type(name)} {name}{'[]' if axes else ''}")
            parameters += [f"int {size}" for size in self.sizes(function, name)]
        parameters = [parameter.replace(" ", NO_BREAK) for parameter in parameters]
        returns = {"float": "double", "None": "void"}.get(function.returns, function.returns)
        return [*self.about(), f"static {returns} {function.name}({', '.join(parameters)})"]

    def about(self) -> list[str]:
        """Return the comment above a function."""
        return comment([self.function.about]).split("\n") if self.function.about else []

    def type(self, name: str) -> str:
        """Return the type of a variable."""
        return {"float": "double"}.get(self.function.kinds[name], self.function.kinds[name])

    def sizes(self, function: ScalarFunction, name: str) -> list[str]:
        """Return the parameters that say how large an array is, as far as its function asks."""
        length = [self.length(name)] if name in function.measured else []
        return length + ([f"{name}_columns"] if function.arrays.get(name) == 2 else [])

    def length(self, name: str) -> str:
        """Write the length of an array."""
        return f"num_{name}"

    def block(self, body: Sequence[ast.stmt], depth: int) -> Iterator[str]:
        """Yield the lines of a block; in the outermost a blank one stands behind the first declarations."""
        before, num_first = "    " * depth, 0
        for position, statement in enumerate(body):
            names = self.function.declared.get(statement, [])
            num_first += bool(names) and position == num_first
            if position == num_first and position > 0 and depth == 1:
                yield ""
            match statement:
                case ast.Assign([ast.Name(name)], value) if name in names:
                    is_const = name in self.function.constant
                    yield f"{before}{self.declaration(name, is_const)} = {self.value(value)};"
                case _:
                    yield from (f"{before}{self.declaration(name, is_const=False)};" for name in names)
                    yield from self.statement(statement, depth)

    def declaration(self, name: str, is_const: bool) -> str:
        """Write a variable where it is declared."""
        return ("const " if is_const else "") + f"{self.type(name)} {name}"

    def statement(self, node: ast.stmt, depth: int) -> Iterator[str]:
        """Yield the lines of a statement."""
        before = "    " * depth
        match node:
            case ast.Assign([target], value):
                yield f"{before}{self.value(target)} = {self.value(value)};"
            case ast.AugAssign(target, operator, value):
                yield f"{before}{self.value(target)} {_BINARY[type(operator)]}= {self.value(value)};"
            case ast.Return(None):
                yield f"{before}return;"
            case ast.Return(ast.expr() as value):
                yield f"{before}return {self.value(value)};"
            case ast.Continue():
                yield f"{before}continue;"
            case ast.Expr(value):
                yield f"{before}{self.value(value)};"
            case ast.While(test, body, []):
                yield f"{before}while ({self.value(test)}) {{"
                yield from self.block(body, depth + 1)
                yield f"{before}}}"
            case ast.For(ast.Name(name), ast.Call(ast.Name("range"), ends), body, []):
                yield f"{before}for ({self.counting(name, ends)}) {{"
                yield from self.block(body, depth + 1)
                yield f"{before}}}"
            case ast.If():
                yield from self.choice(node, depth)
            case _:
                raise NotTranscribed(node)

    def counting(self, name: str, ends: Sequence[ast.expr]) -> str:
        """Write what stands in the brackets of a loop that counts."""
        texts = [self.value(end) for end in ends]
        first, last = texts[:2] if len(texts) > 1 else ("0", texts[0])
        if len(texts) == 3:
            return f"{self.declaration(name, is_const=False)} = {first}; {name} > {last}; --{name}"
        last = last if re.fullmatch(r"[\w.]+", last) else f"({last})"
        return f"{self.declaration(name, is_const=False)} = {first}; {name} < {last}; ++{name}"

    def choice(self, node: ast.If, depth: int, opening: str = "if") -> Iterator[str]:
        """Yield the lines of a choice; one between more than two ends in what is done otherwise."""
        before = "    " * depth
        yield f"{before}{opening} ({self.value(node.test)}) {{"
        yield from self.block(node.body, depth + 1)
        match node.orelse:
            case []:
                if opening != "if":
                    yield from (f"{before}}} else {{", f"{before}    /* nothing */")
                yield f"{before}}}"
            case [ast.If() as another]:
                yield from self.choice(another, depth, "} else if")
            case _:
                yield f"{before}}} else {{"
                yield from self.block(node.orelse, depth + 1)
                yield f"{before}}}"

    def value(self, node: ast.expr) -> str:  # noqa: PLR0911 - one for each kind of node
        """Write an expression."""
        match node:
            case ast.Constant(int() | float() as value):
                return self.number(value)
            case ast.Name(name):
                return name
            case ast.Subscript(ast.Name(name), index):
                return self.element(name, index)
            case ast.UnaryOp(operator, operand):
                return {ast.USub: "-", ast.Not: "!"}[type(operator)] + self.operand(operand)
            case ast.BinOp(left, operator, right) if type(operator) in _BINARY:
                is_bare = isinstance(left, ast.UnaryOp) or _is_chain(left, operator)
                first, second = self.value(left) if is_bare else self.operand(left), self.operand(right)
                kinds = self.function.kind(left), self.function.kind(right)
                if kinds == ("int", "float"):
                    first = self.widened(first)
                if kinds == ("float", "int"):
                    second = self.widened(second)
                return self.quotient(f"{first} {_BINARY[type(operator)]} {second}")
            case ast.BoolOp(operator, values):
                sign = " && " if isinstance(operator, ast.And) else " || "
                return sign.join(map(self.operand, values))
            case ast.Compare(left, operators, others):
                sides = [self.operand(side) for side in (left, *others)]
                signs = [self.sign(_COMPARE[type(operator)]) for operator in operators]
                pairs = [f"{a} {sign} {b}" for a, sign, b in zip(sides[:-1], signs, sides[1:], strict=True)]
                return pairs[0] if len(pairs) == 1 else " && ".join(f"({pair})" for pair in pairs)
            case ast.IfExp(test, body, orelse):
                return f"{self.operand(test)} ? {self.operand(body)} : {self.operand(orelse)}"
            case ast.Call(_, arguments):
                return self.call(node, arguments)
        raise NotTranscribed(node)

    def operand(self, node: ast.expr) -> str:
        """Write an expression as part of another one."""
        text = self.value(node)
        match node:
            case ast.Constant():
                is_whole = not text.startswith("-")
            case ast.Call(ast.Name("float"), [inner]):
                return self.operand(inner)
            case _:
                is_whole = isinstance(node, ast.Name | ast.Subscript | ast.Call)
        return text if is_whole else f"({text})"

    def widened(self, text: str) -> str:
        """Write a whole number that is combined with one that is not."""
        return f"(double){text}"

    def quotient(self, text: str) -> str:
        """Write an operation of two numbers; a quotient of whole ones is one in C."""
        return text.replace(" // ", " / ")

    def number(self, value: float) -> str:
        """Write a number."""
        return str(value).lower() if isinstance(value, bool) else exact(value)

    def sign(self, sign: str) -> str:
        """Write a comparison."""
        return sign

    def element(self, name: str, index: ast.expr) -> str:
        """Write an element of an array."""
        if isinstance(index, ast.Tuple):
            row, column = map(self.operand, index.elts)
            start = f"{row} * {name}_columns"
            return f"{name}[{start}]" if column == "0" else f"{name}[({start}) + {column}]"
        return f"{name}[{self.value(index)}]"

    def call(self, node: ast.Call, arguments: Sequence[ast.expr]) -> str:
        """Write a call."""
        values = [self.value(argument) for argument in arguments]
        if node in self.function.calls:
            callee = self.function.calls[node]
            for position in reversed(range(len(values))):
                sizes = self.sizes(callee, callee.parameters[position])
                values[position + 1 : position + 1] = [
                    size.replace(callee.parameters[position], values[position]) for size in sizes
                ]
            return f"{callee.name}({', '.join(values)})"
        name = node.func.attr if isinstance(node.func, ast.Attribute) else ast.unparse(node.func)
        if name == "float":
            return values[0]
        if name == "len":
            return self.length(values[0])
        if (name in ("min", "max", "abs") and self.function.kind(node) == "int") or not self.has(name):
            raise NotTranscribed(node)
        return f"{self.library(_CALLED.get(name, name))}({', '.join(values)})"

    def has(self, name: str) -> bool:
        """Return whether a function is one of the library."""
        return hasattr(math, _CALLED.get(name, name)) or name in _CALLED

    def library(self, name: str) -> str:
        """Write the name of a function of the library."""
        return name

    def calling(
        self, function: ScalarFunction, values: Mapping[str, str], sizes: Mapping[str, Sequence[int]]
    ) -> str:
        """Write a call from elsewhere.

        Parameters
        ----------
        function : ScalarFunction
        values : mapping of str to str
            What each parameter is texts.
        sizes : mapping of str to sequence of int
            The length of each array, and its number of columns if it has two axes.
        """
        texts: list[str] = []
        for name in function.parameters:
            texts.append(values[name])
            texts += map(str, sizes[name][:1] if name in function.measured else ())
            texts += map(str, sizes[name][-1:] if function.arrays.get(name) == 2 else ())
        return f"{function.name}({', '.join(texts)})"


def _is_chain(left: ast.expr, operator: ast.operator) -> bool:
    """Return whether an operation goes on from another of its kind, so that both need no brackets."""
    if not isinstance(left, ast.BinOp):
        return False
    alike = ((ast.Add, ast.Sub), (ast.Mult, ast.Div))
    return any(isinstance(left.op, kinds) and isinstance(operator, kinds) for kinds in alike)
