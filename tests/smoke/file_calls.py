"""Where the program's source opens files: through `plain_files.file_access`, or otherwise."""

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

from tests.places import PACKAGES, PROJECT

#: the module that opens and writes files, and its functions by what they do
DOOR: Final = "plain_files.file_access"
READERS: Final = frozenset({"open_regular", "open_text", "read_bytes", "read_text"})
WRITERS: Final = frozenset(
    {"replacing", "create", "write_bytes", "write_text", "rename", "open_folder", "open_lock"}
)
SHIPPED: Final = "read_shipped"
#: why a call opens something by itself: no file, or none that another person could have put there
REASON: Final = re.compile(r"# file: (\S.+)")

#: methods of paths that open a file, make one or give it another name
OF_PATHS: Final = frozenset(
    {"open", "read_text", "read_bytes", "write_text", "write_bytes", "symlink_to", "hardlink_to", "rename"}
)
#: functions and methods of libraries that open a file where they are given no stream
OF_LIBRARIES: Final = frozenset(
    {
        *("load", "loadtxt", "genfromtxt", "fromfile", "memmap", "save", "savez", "savetxt", "load_mesh"),
        *("read_table", "read_schema", "read_metadata", "ParquetFile", "ParquetWriter", "write_table"),
        *("read_csv", "write_csv", "ZipFile", "imread", "imsave", "open", "fdopen", "load_model", "TFile"),
        *("SummaryWriter", "RecordWriter"),
        *("mkstemp", "NamedTemporaryFile", "TemporaryFile", "mktemp"),
        *("copy2", "copyfile", "copytree", "move", "rename", "replace", "link", "symlink"),
    }
)
OF_FIGURES: Final = frozenset({"savefig", "save_screenshot"})
#: what makes a stream, or data that was read
STREAMS: Final = READERS | WRITERS | {"BytesIO", "StringIO", "BufferReader", "beside", SHIPPED}


@dataclass(frozen=True)
class Call:
    """A call that opens or writes a file: what is called, and in which function of which module.

    The reason why it does so by itself stands in a comment on its line, if at all.
    """

    name: str
    module: str
    function: str
    line: int
    reason: str = ""

    @property
    def site(self) -> str:
        """The function that calls, by its module."""
        return f"{self.module}.{self.function}"


@cache
def calls() -> tuple[Call, ...]:
    """Return all calls of the packages that open files."""
    all_calls: list[Call] = []
    for package in PACKAGES:
        for path in sorted((PROJECT / package).rglob("*.py")):
            module = ".".join(path.relative_to(PROJECT).with_suffix("").parts).removesuffix(".__init__")
            if module != DOOR:
                source = path.read_text(encoding="utf-8")
                lines = source.splitlines()
                all_calls += (
                    replace(each, reason="".join(REASON.findall(lines[each.line - 1])))
                    for each in calls_of(ast.parse(source), module)
                )
    return tuple(all_calls)


def calls_of(tree: ast.AST, module: str) -> Iterator[Call]:
    """Yield the calls of a module that open files."""
    libraries = frozenset(libraries_of(tree))
    scopes: list[tuple[str, ast.AST]] = [("", tree)]
    while scopes:
        name, scope = scopes.pop()
        streams = streams_of(scope)
        for node in inside(scope):
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
                scopes.append((f"{name}.{node.name}".lstrip("."), node))
            elif isinstance(node, ast.Call) and opens(node, streams, libraries):
                yield Call(ast.unparse(node.func), module, name, node.lineno)


def libraries_of(tree: ast.AST) -> Iterator[str]:
    """Yield the names that a module gives to what it imports from elsewhere."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            source = getattr(node, "module", None) or node.names[0].name
            if source.partition(".")[0] not in (*PACKAGES, "yaml", "json", "tomllib"):  # these read streams
                yield from (alias.asname or alias.name.partition(".")[0] for alias in node.names)


def inside(scope: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a scope, and the functions and classes in it, but not what these hold."""
    nodes = list(ast.iter_child_nodes(scope))
    while nodes:
        node = nodes.pop()
        yield node
        if not isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
            nodes += ast.iter_child_nodes(node)


def streams_of(scope: ast.AST) -> frozenset[str]:
    """Return the names that a scope gives to streams."""
    names = set()
    for node in inside(scope):
        if isinstance(node, ast.With | ast.AsyncWith):
            pairs = [(item.context_expr, item.optional_vars) for item in node.items]
        elif isinstance(node, ast.Assign):
            pairs = [(node.value, target) for target in node.targets]
        else:
            continue
        for value, target in pairs:
            values = value.elts if isinstance(value, ast.Tuple) else [value]
            targets = target.elts if isinstance(target, ast.Tuple) else [target]
            if len(values) == len(targets):
                names |= {
                    each.id
                    for each, made in zip(targets, values, strict=True)
                    if isinstance(each, ast.Name) and is_stream(made, frozenset())
                }
    return frozenset(names)


def is_stream(node: ast.AST, streams: frozenset[str]) -> bool:
    """Return whether an argument is a stream: made by what makes one, or called so."""
    if isinstance(node, ast.Name):
        return node.id in streams
    if not isinstance(node, ast.Call):
        return False
    is_entered = called(node) == "enter_context" and is_stream(node.args[0], streams)
    return called(node) in STREAMS or is_entered


def called(call: ast.Call) -> str:
    """Return the last name of what is called."""
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def opens(call: ast.Call, streams: frozenset[str], libraries: frozenset[str]) -> bool:
    """Return whether a call opens a file."""
    name = called(call)
    takes_stream = any(is_stream(each, streams) for each in call.args)
    if not isinstance(call.func, ast.Attribute):
        return name in READERS | WRITERS | {SHIPPED, "open"} or (
            name in libraries and name in OF_LIBRARIES - {"replace"} and not takes_stream
        )
    base: ast.AST = call.func
    while isinstance(base, ast.Attribute):
        base = base.value
    if isinstance(base, ast.Name) and base.id in libraries:
        return name in OF_LIBRARIES | OF_PATHS and not takes_stream
    if name == "replace":  # of a path: a text's has two arguments
        return len(call.args) == 1 and not call.keywords
    return name in OF_PATHS or (name in OF_FIGURES and not takes_stream)
