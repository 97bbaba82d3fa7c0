"""The page of a system that has nothing to do with space has no word of space, with a log and without."""

import re
from pathlib import Path

import numpy as np
import pytest

from fis_tools.review import page
from fis_tools.source import read_controller
from tests.fis_tools.review.cases import Markup, path_of
from tests.places import PROJECT

pytestmark = pytest.mark.slow

OF_SPACE = (
    r"\b(spac\w+|orbit\w*|satellites?|chief|deputy|fl(y|ies|ying|ew|own|ights?)|sun|sunlit|camera|thrust\w*"
    r"|delta-v|inspect\w*|episodes?|coast\w*|mission|hill|forces? (was|were))\b"
)


@pytest.mark.parametrize("has_log", [False, True])
def test_a_page_has_no_word_of_space(opened, tmp_path: Path, has_log: bool) -> None:
    controller = read_controller(PROJECT / "docs" / "examples" / "tipper.fis")
    log = tmp_path / "evening.csv"
    rows = path_of(controller.systems[0], 30)
    np.savetxt(log, rows, delimiter=",", header="service,food", comments="")
    text = page.write(controller, [log] if has_log else [])
    markup = Markup(text)
    told = [words for tag, words in markup.texts if tag not in {"script", "style"}]
    labels = [words for name in ("aria-label", "title", "placeholder") for words in markup.values(name)]
    shown = opened(text.replace('<details class="part">', '<details class="part" open>'))
    drawn = shown.evaluate(
        "[document.body.textContent.replace(document.getElementById('carried').textContent, ''),"
        " ...[...document.querySelectorAll('[aria-label]')].map((one) => one.ariaLabel)].join(' ')"
    )
    script = next(words for tag, words in markup.texts if tag == "script" and '"use strict"' in words)
    everything = " ".join([*told, *labels, drawn.replace(script, "")])
    assert ("along the log" in everything) == has_log
    assert re.findall(OF_SPACE, everything, re.IGNORECASE) == []
    if has_log:
        assert "row 1" in shown.locator(".live.flight").first.inner_text()
