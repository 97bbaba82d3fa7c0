"""JSON that somebody may have written is read by one function, which makes its texts plain."""

import ast

import pytest

from tests.places import PACKAGES, PROJECT

#: readers of their own: ours in a strict notation, the checker that imports no code of ours, and evolution,
#: which knows no other package
OWN_READERS = {
    "plain_files/plain_text.py",
    "fis_tools/formats/notation.py",
    "pipeline/proof/strict.py",
    "pipeline/training/evolution/state.py",
}


def is_copied(call: ast.Call) -> bool:
    """Whether data goes through JSON and back: `json.loads(json.dumps(...))`."""
    return (
        bool(call.args)
        and isinstance(call.args[0], ast.Call)
        and ast.unparse(call.args[0].func) == "json.dumps"
    )


#: of `json`, what parses, and other libraries that would
PARSING = {"load", "loads", "JSONDecoder"}
OTHERS = {"orjson", "ujson", "simplejson", "rapidjson", "msgspec", "demjson3", "json5", "commentjson"}


def parses(node: ast.AST) -> bool:
    """Whether a piece of code parses JSON, or takes hold of what does, also by another name."""
    if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "json":
        return bool({alias.name for alias in node.names} & {*PARSING, "*", "decoder", "scanner"})
    if isinstance(node, ast.Import | ast.ImportFrom):
        names = {alias.name: alias.asname for alias in node.names}
        module = getattr(node, "module", None)
        return bool(OTHERS & ({module} if module else set(names))) or bool(not module and names.get("json"))
    return isinstance(node, ast.Attribute) and ast.unparse(node) in {f"json.{name}" for name in PARSING}


@pytest.mark.parametrize(
    "code",
    [
        *("json.loads(x)", "json.load(x)", "read = json.loads", "json.JSONDecoder().decode(x)"),
        *("import json as j", "from json import loads", "from json.decoder import JSONDecoder"),
        *("import orjson", "from msgspec import decode"),
    ],
)
def test_every_way_to_parse_is_noticed(code):
    assert any(map(parses, ast.walk(ast.parse(code))))


def test_json_is_parsed_in_one_place():
    parsed = set()
    for package in PACKAGES:
        for path in (PROJECT / package).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            copied = {node.func for node in ast.walk(tree) if isinstance(node, ast.Call) and is_copied(node)}
            if any(parses(node) for node in ast.walk(tree) if node not in copied):
                parsed.add(path.relative_to(PROJECT).as_posix())
    assert parsed == OWN_READERS
