"""The player in Firefox: the product's bits, presses and keys, one time, as in the browser of other tests."""

import pytest

from tests.firefox import firefox
from tests.pipeline.player.pages import LOG, decoded, page_of, run_of

pytestmark = pytest.mark.slow


@pytest.fixture
def page(tmp_path):
    path = tmp_path / "page.html"
    path.write_text(page_of("champion_27"), encoding="utf-8")
    with firefox(tmp_path) as page:
        page.open(path, 1280, 900)
        page.wait_for("globalThis.player?.sides?.[0].flight")
        yield page


def test_it_flies_the_products_bits_and_opens_cases_in_firefox(page):
    logs = run_of("champion_27")[3]
    for row in (0, 9):
        again = page.evaluate(f"({LOG})({row})")
        assert decoded(again["position"], "<f8").tobytes() == logs[row].position_m.tobytes()
        assert decoded(again["spent"], "<f8").tobytes() == logs[row].delta_v_m_s.tobytes()
    left, top = page.evaluate(
        """(() => {
            const canvas = document.querySelector(".fuel-dots canvas");
            canvas.scrollIntoView({ block: "center", behavior: "instant" });
            const box = canvas.getBoundingClientRect(), [x, y] = player.dots[0].where(8);
            return [box.x + x, box.y + y];
        })()"""
    )
    page.click(left, top)
    page.wait_for("player.row === 8 && player.part('which').textContent.endsWith('Case 108')")
    page.evaluate("document.querySelector('#player .time').focus()")
    page.press("Home")
    page.press("ArrowRight")
    # drawn with the next picture
    page.wait_for(
        """[...document.querySelectorAll("#player svg[role=slider]")]
            .every(each => +each.getAttribute("aria-valuenow") === 1)"""
    )
    read = "[+document.querySelector('#player .time').value, player.sides[0].view.sample]"
    assert page.evaluate(read) == [1, 1]
