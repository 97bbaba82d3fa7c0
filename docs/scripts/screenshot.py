"""Pictures of pages, by a browser without a window."""

import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

#: programs that open pages, as Debian names them; the shell has no window and takes a third of the time
BROWSERS = ("chromium-headless-shell", "chromium")

#: unfolds what a heading may be the summary of, and scrolls there
SHOW = """heading => {
    heading.closest("details")?.setAttribute("open", "");
    heading.scrollIntoView();
}"""


def browser_found() -> str | None:
    """Return the path of a browser."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def screenshot(page: Path, heading: str, picture: Path, width: int = 1100, height: int = 1230) -> None:
    """Save what a window shows of a page on disk, from a heading on, with what it holds unfolded.

    Without a browser, nothing is saved.
    """
    program = browser_found()
    if program is None:
        return
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        tab = browser.new_page(viewport={"width": width, "height": height})
        tab.goto(page.resolve().as_uri())
        tab.get_by_role("heading", name=heading).first.evaluate(SHOW)
        tab.wait_for_timeout(1000)  # surfaces are drawn after the page has loaded
        tab.screenshot(path=picture)
        browser.close()
