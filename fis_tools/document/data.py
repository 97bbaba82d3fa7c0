"""Results as plain data, and as JSON for programs."""

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any


def plain(value: Any) -> Any:
    """Return data that JSON holds: objects of data classes by the names of their fields, arrays as lists."""
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value.tolist() if hasattr(value, "tolist") else value


def write(schema: str, version: int, content: Mapping[str, Any]) -> str:
    """Write data as JSON that says which schema it follows; keys may be added to a version, not changed."""
    told = {"schema": schema, "schema_version": version, **content}
    return json.dumps(told, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
