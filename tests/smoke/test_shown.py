"""What the pages show of commands is what these print."""

import pytest

from docs.shown import PAGES, rerun, shown
from tests.smoke.pages import DOCS


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_a_page_shows_what_its_commands_print(name, tmp_path):
    """If this fails after a change that is meant: ``python -m docs.shown``."""
    page = (DOCS / name).read_text(encoding="utf-8")
    assert rerun(page, tmp_path) == page


def test_a_page_may_leave_lines_out():
    printed = "one\ntwo\nthree\nfour\n"
    assert shown("stale\n", printed) == printed
    assert shown("one\n…\nfour\n", printed) == "one\n…\nfour\n"
    with pytest.raises(ValueError, match="which is not among what is printed"):
        shown("one\n…\nfive\n", printed)


def test_pictures_of_the_gallery_are_shown_and_those_shown_exist():
    folder = DOCS / "images" / "gallery"
    text = "".join((DOCS / name).read_text(encoding="utf-8") for name in PAGES)
    assert sorted(path.name for path in folder.iterdir() if path.name not in text) == []
