"""JSON that somebody may have written is read by one function, which makes its texts plain."""

import ast

from tests.places import PROJECT

#: readers of their own: ours in a strict notation, the checker that imports no code of ours, recordings,
#: whose texts `telemetry.file.metadata` makes plain, and evolution, which knows no other package
OWN_READERS = {
    "fis_tools/plain_text.py",
    "fis_tools/formats/notation.py",
    "pipeline/proof/strict.py",
    "pipeline/training/evolution/state.py",
    "telemetry/file/metadata.py",
    "telemetry/scene/runs.py",
}


def is_copied(call: ast.Call) -> bool:
    """Whether data goes through JSON and back: `json.loads(json.dumps(...))`."""
    return isinstance(call.args[0], ast.Call) and ast.unparse(call.args[0].func) == "json.dumps"


def test_json_is_parsed_in_one_place():
    parsed = set()
    for package in ("pipeline", "fis_tools", "telemetry"):
        for path in (PROJECT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                name = ast.unparse(node) if isinstance(node, ast.Attribute) else ""
                is_call = isinstance(node, ast.Call) and ast.unparse(node.func) in ("json.loads", "json.load")
                if (is_call and not is_copied(node)) or name == "json.JSONDecoder":
                    parsed.add(path.relative_to(PROJECT).as_posix())
    assert parsed == OWN_READERS
