"""What every page that we write lets a browser do: run its own scripts, and fetch nothing."""

import base64
import hashlib
import re

META = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
SCRIPT = re.compile(r"<script(?![^>]*application/json)[^>]*>(.*?)</script>", re.DOTALL)
HANDLER = re.compile(r"<[a-z][^>]*\son[a-z]+\s*=", re.IGNORECASE)


def source_hash(text: str) -> str:
    """Return what a policy calls a script or a style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def check_policy(page: str) -> None:
    """Fail unless a page forbids everything but its own scripts, its styles and pictures that it carries."""
    (policy,) = META.findall(page)
    head = page[: page.index(policy)]
    assert "<style" not in head
    assert "<script" not in head
    told = {words[0]: words[1:] for words in (part.split() for part in policy.split(";"))}
    assert told.pop("default-src") == ["'none'"]
    assert told.pop("base-uri") == ["'none'"]
    assert told.pop("form-action") == ["'none'"]
    assert told.pop("script-src", []) == [f"'{source_hash(script)}'" for script in SCRIPT.findall(page)]
    assert set(told.pop("img-src", [])) <= {"data:", "blob:"}
    styles = told.pop("style-src")
    assert styles == ["'unsafe-inline'"] or all(one.startswith("'sha256-") for one in styles)
    assert not told
    assert not HANDLER.search(page)
