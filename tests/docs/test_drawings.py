"""The drawings of the pages are those that the product's laws give today."""

import re
from pathlib import Path

import pytest

from docs.drawings import DRAWINGS, FOLDER

PAGES = "".join(path.read_text(encoding="utf-8") for path in Path("docs").rglob("*.md"))


@pytest.mark.slow
@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_up_to_date_and_shown(name):
    assert (FOLDER / f"{name}.svg").read_text(encoding="utf-8") == DRAWINGS[name]().text()
    (alternative,) = set(re.findall(rf"!\[([^\]]+)\]\(\S*images/drawings/{name}\.svg\)", PAGES))
    assert len(alternative) > 40
