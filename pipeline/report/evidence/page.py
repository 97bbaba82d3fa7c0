"""The page of evidence."""

import json
from collections.abc import Mapping
from typing import Any


def write(evidence: Mapping[str, Any]) -> str:
    """Write the page."""
    return json.dumps(evidence)
