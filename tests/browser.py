"""One browser for all tests of pages; a page that asks for anything, or complains, fails."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, sync_playwright

from docs.scripts.screenshot import BROWSERS, browser_found
from tests import night
from tests.programs import installed, missing

#: no sandbox, no screen, and no word to anybody
ARGUMENTS = (
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--force-color-profile=srgb"),
)
#: in what width and colours a page is looked at; by day each of both
LOOKS = night.by_day([(1400, "light"), (1400, "dark"), (400, "dark"), (400, "light")], 2)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    path = browser_found() or missing(f"no browser is installed; apt-get install {BROWSERS[0]}")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield browser
        browser.close()


@pytest.fixture(scope="session")
def axe(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The script of axe-core, which finds what keeps people from using a page."""
    folder = installed(Path(__file__).parent / "axe", tmp_path_factory.mktemp("npm") / "axe")
    return (folder / "node_modules" / "axe-core" / "axe.min.js").read_text(encoding="utf-8")


#: waits until a change of style is seen and its transitions are over
AT_REST = """async () => {
    for (const _ of "12") await new Promise(requestAnimationFrame);
    const ends = document.getAnimations().filter(a => a.effect.getComputedTiming().iterations !== Infinity);
    await Promise.allSettled(ends.map(animation => animation.finished));
}"""


def serious_violations(shown: Page, axe: str) -> list[tuple[str, list[str]]]:
    """Return what axe finds on a page that keeps people from using it, with the first places."""
    shown.evaluate(axe)
    shown.evaluate(AT_REST)  # colours that still change from light to dark have neither's contrast
    report = shown.evaluate("axe.run(document, { resultTypes: ['violations'] })")
    assert len(report["passes"]) > 20
    return [
        (violation["id"], [node["html"][:150] for node in violation["nodes"][:3]])
        for violation in report["violations"]
        if violation["impact"] in {"serious", "critical"}
    ]


#: what keeps a shortcut of the browser, such as Alt and an arrow or Ctrl and plus, from it
SWALLOWED = """() => {
    const keys = ["ArrowLeft", "ArrowRight", "ArrowUp", "PageDown", "Home", "+", "-", " "];
    const isKept = (each, key, held) => !each.dispatchEvent(
        new KeyboardEvent("keydown", { key, [held]: true, cancelable: true, bubbles: true }));
    return [...document.querySelectorAll("canvas, input, select, button, [tabindex]")].filter(each =>
        ["ctrlKey", "altKey", "metaKey"].some(held => keys.some(key => isKept(each, key, held)))
    ).map(each => each.outerHTML.slice(0, 150));
}"""
#: of a phone, a laptop and a large screen
WIDTHS = (400, 1400, 1920)
#: the tables of a page by class and number of columns, all folds opened
TABLES = """() => {
    document.querySelectorAll("details").forEach(fold => { fold.open = true; });
    const tables = [...document.querySelectorAll("table")];
    return tables.map(each => `${each.className} ${each.rows[0]?.cells.length}`);
}"""
#: those that do not fit what holds them, or leave the page
TOO_WIDE = """() => [...document.querySelectorAll("table")].filter(each =>
    each.offsetWidth > each.parentElement.clientWidth + 1
    || each.getBoundingClientRect().right > innerWidth + 1
).map(each => [innerWidth, each.offsetWidth, each.innerText.slice(0, 200)])"""
#: kinds of pages whose tables fit, by their tables
_fitting: set[tuple[str, ...]] = set()


def assert_tables_fit(page: Page) -> None:
    """Fail where a column of a table is hidden at some width."""
    kinds = tuple(sorted(set(page.evaluate(TABLES))))
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        wide = page.evaluate(TOO_WIDE)
        assert wide == [], wide
    _fitting.add(kinds)


def has_new_tables(page: Page) -> bool:
    """Return whether no page yet had tables of these kinds."""
    kinds = tuple(sorted(set(page.evaluate(TABLES))))
    return bool(kinds) and kinds not in _fitting


@pytest.fixture
def opened(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Page]]:
    """Open a text as a page, as often as a test likes."""
    with opening(browser, tmp_path_factory.mktemp("pages")) as open_page:
        yield open_page


@contextmanager
def opening(browser: Browser, folder: Path) -> Iterator[Callable[..., Page]]:
    """Open a text as a page from a file.

    In the end nothing but the file was asked for, nothing was wrong, and no table is wider than its page.
    """
    complaints: list[str] = []
    contexts: list[BrowserContext] = []

    def open_page(text: str, width: int = 1280, **options: object) -> Page:
        path = folder / f"page-{len(contexts)}.html"
        path.write_text(text, encoding="utf-8")
        context = browser.new_context(viewport={"width": width, "height": 900}, offline=True, **options)
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda message: complaints.append(f"console: {message.text}"))
        page.on("pageerror", lambda error: complaints.append(f"error: {error}"))
        page.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))
        # what a page made itself, such as a worker, nobody is asked for
        allowed = (path.as_uri(), "blob:", "data:")
        page.on(
            "request",
            lambda request: request.url.startswith(allowed) or complaints.append(f"request: {request.url}"),
        )
        page.goto(path.as_uri())
        return page

    yield open_page
    for context in contexts:
        for page in filter(has_new_tables, context.pages):
            assert_tables_fit(page)
        context.close()
    assert complaints == []
