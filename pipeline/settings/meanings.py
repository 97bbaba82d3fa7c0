"""The meaning of each key: the text below its field in the sources of the classes of settings."""

import ast
import inspect
import sys
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.settings.controllers import PLANNED
from pipeline.settings.groups import GROUPS
from pipeline.settings.keys import FREE


@cache
def descriptions() -> dict[str, str]:
    """Return the meaning of each key, and of each group, from the sources of their classes."""
    told: dict[str, str] = {}
    for group, kind, _ in GROUPS:
        prefix = f"{_group_of(group, kind)}." if group else ""
        told[prefix.rstrip(".")] = (inspect.getdoc(kind) or "").partition("\n")[0]
        for owner in inspect.getmro(kind)[:-1]:
            for name, text in (
                _meanings(sys.modules[owner.__module__].__file__ or "").get(owner.__name__, {}).items()
            ):
                told.setdefault(prefix + name, text)
    return told


@cache
def _meanings(path: str) -> dict[str, dict[str, str]]:
    """Return the texts below the fields of each class in a source file."""
    tree = ast.parse(Path(path).read_text(encoding="utf-8"))
    found: dict[str, dict[str, str]] = {}
    for node in (node for node in tree.body if isinstance(node, ast.ClassDef)):
        for field, below in zip(node.body, node.body[1:], strict=False):
            is_text = isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
            if is_text and isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                words = " ".join(str(below.value.value).split())  # type: ignore[attr-defined]
                found.setdefault(node.name, {})[field.target.id] = words
    return found


def _group_of(group: str, kind: Any) -> str:
    """Return the name of a group; controllers that plan have one each."""
    return next((f"{FREE} ({name})" for name, one in PLANNED.items() if one is kind), group)
