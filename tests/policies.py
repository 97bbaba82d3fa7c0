"""Pages that we write: taken to pieces, and what they let a browser do."""

import base64
import gzip
import hashlib
import re
from collections import defaultdict
from collections.abc import Sequence
from html.parser import HTMLParser

META = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">')
SCRIPT = re.compile(r"<script(?![^>]*application/json)[^>]*>(.*?)</script>", re.DOTALL)
PACKED = re.compile(r'text = "([^"]+)", size')
HANDLER = re.compile(r"<[a-z][^>]*\son[a-z]+\s*=", re.IGNORECASE)


def source_hash(text: str) -> str:
    """Return what a policy calls a script or a style."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def begun(script: str) -> list[str]:
    """Return a script, and the one that it unpacks and begins, if it does."""
    packed = (base64.b85decode(text.replace(",", "<")) for text in PACKED.findall(script))
    return [script, *(gzip.decompress(each).decode() for each in packed)]


def check_policy(page: str) -> None:
    """Fail unless a page forbids everything but its own scripts, its styles and pictures that it carries."""
    (policy,) = META.findall(page)
    head = page[: page.index(policy)]
    assert "<style" not in head
    assert "<script" not in head
    directives = {words[0]: words[1:] for words in (part.split() for part in policy.split(";"))}
    assert directives.pop("default-src") == ["'none'"]
    assert directives.pop("base-uri") == ["'none'"]
    assert directives.pop("form-action") == ["'none'"]
    hashes = [f"'{source_hash(script)}'" for each in SCRIPT.findall(page) for script in begun(each)]
    if directives.pop("worker-src", None) == ["blob:"]:  # of pages that fly
        hashes.append("'wasm-unsafe-eval'")
    assert directives.pop("script-src", []) == hashes
    assert set(directives.pop("img-src", [])) <= {"data:", "blob:"}
    styles = directives.pop("style-src")
    assert styles == ["'unsafe-inline'"] or all(style.startswith("'sha256-") for style in styles)
    assert not directives
    assert not HANDLER.search(page)


class Page(HTMLParser):
    """A page taken to pieces: tags with attributes, texts by tag and by section; its tags must match."""

    VOID = frozenset(("meta", "link", "br", "img", "hr", "input", "source", "wbr"))

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        self.text: dict[str, str] = defaultdict(str)
        self.stack: list[tuple[str, str]] = []
        self.feed(page)
        self.close()
        assert self.stack == []

    def handle_starttag(self, tag: str, attrs: Sequence[tuple[str, str | None]]) -> None:
        attributes = {name: value or "" for name, value in attrs}
        assert len(attributes) == len(attrs)
        self.tags.append((tag, attributes))
        if tag not in self.VOID:
            self.stack.append((tag, attributes.get("id", "")))

    def handle_endtag(self, tag: str) -> None:
        assert self.stack.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        self.texts.append((self.stack[-1][0] if self.stack else "", data))
        for tag, name in self.stack:
            if tag == "section" and name:
                self.text[name] += data

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]

    def values(self, name: str) -> list[str]:
        """All values of an attribute."""
        return [attributes[name] for _, attributes in self.tags if name in attributes]


def check_references(text: str) -> None:
    """Fail unless each name on a page is given once, and each reference on it has its target."""
    page = Page(text)
    ids = page.values("id")
    assert len(ids) == len(set(ids))
    wanted = set(re.findall(r"url\(#([^)]+)\)", SCRIPT.sub("", text))) | set(
        " ".join(page.values("aria-labelledby")).split()
    )
    wanted |= {target[1:] for target in page.values("href") if target.startswith("#")}
    assert wanted <= set(ids)
