"""Pages that are opened."""

import pytest

from tests.pipeline.player.pages import page_of


@pytest.fixture
def ready(opened):
    """Open a page, and wait for its first flight."""

    def open_page(*words, width=1280, address="", recorded=(), **options):
        page = opened(page_of(*words, recorded=recorded), width, reduced_motion="reduce", **options)
        # a busy machine may take long to compile the module
        page.wait_for_function("() => globalThis.player?.sides?.[0].flight", timeout=300_000)
        if address:
            case = address.partition("case=")[2].partition("&")[0]
            page.evaluate("address => { location.hash = address; }", address)
            page.wait_for_function("number => player.cases.numbers[player.row] === number", arg=int(case))
        return page

    return open_page
