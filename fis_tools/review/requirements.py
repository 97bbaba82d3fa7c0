"""The requirements of an evidence file and what became of them, as rows of the page."""

import json
from pathlib import Path
from typing import Any

from fis_tools.errors import ControllerFileError

SCHEMA = "evidence"


def read_evidence(path: Path | str, fingerprint: str) -> tuple[dict[str, Any], list[dict[str, str]]]:
    """Return evidence, and of each requirement its name and its verdict in words.

    Raises
    ------
    ControllerFileError
        If the file cannot be read, is no evidence, or is about another controller.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise ValueError(content["schema"])
        about = content["controller"]
        found = [
            {
                "name": " ".join(str(one[key]) for key in ("id", "title") if key in one),
                "words": str(one.get("sentence") or f"{one['verdict']}: {one['text']} {one['why']}"),
            }
            for one in content["requirements"]
        ]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ControllerFileError(
            f"{path} is no evidence that can be read ({error}); give the evidence.json that "
            "`python -m pipeline assure RUN` writes"
        ) from error
    if about.get("sha256") != fingerprint:
        raise ControllerFileError(
            f"{path} is about the controller {about.get('name')!r} with the SHA-256 {about.get('sha256')}, "
            f"but this one has {fingerprint}; give the evidence of this controller"
        )
    return content, found
