"""The drawings of the pages are those that the product's laws give today."""

import re
from pathlib import Path

import pytest

from docs.scripts.drawings import DRAWINGS, FOLDER

PAGES = "".join(path.read_text(encoding="utf-8") for path in Path("docs").rglob("*.md"))


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_up_to_date_and_shown(name):
    assert (FOLDER / f"{name}.svg").read_text(encoding="utf-8") == DRAWINGS[name]().text()
    alternatives = re.findall(rf"!\[([^\]]+)\]\(\S*images/drawings/{name}\.svg\)", PAGES)
    assert alternatives
    assert all(len(text) > 40 for text in alternatives)


@pytest.mark.parametrize("folder", ["explanation", "tutorial"])
def test_each_page_has_a_picture(folder):
    pages = sorted(Path("docs", folder).glob("*.md"))
    # a drawing in a text counts, as that of the data flow
    bare = [page.name for page in pages if not re.search(r"!\[|──►", page.read_text(encoding="utf-8"))]
    assert pages
    assert bare == []
