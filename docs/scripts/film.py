"""The flight of the README and the overview as an animation, filmed from the first page."""

import io
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from docs.scripts import home
from docs.scripts.screenshot import browser_found

#: every so many samples is a frame; in most of the second half the deputy coasts
SAMPLES = (*range(0, 150, 3), *range(150, 361, 12))
FRAME_MS = 220
SIZE = (860, 570)
#: only the flight and the rule behind the largest push, larger, as in a film
SET = """() => {
    const flight = document.getElementById("scene");
    document.body.replaceChildren(flight);
    flight.querySelector(".playback").style.display = "none";
    flight.querySelector("canvas").style.height = "470px";
    flight.style.cssText += "font-size: 17px; display: flex; flex-direction: column; height: 100vh";
    flight.querySelector(".why").style.flex = 1;
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(".why p:not(:first-child) { display: none }");
    document.adoptedStyleSheets.push(sheet);
    document.documentElement.style.background = document.body.style.background = "white";
}"""


def film(output: Path) -> None:
    """Write the flight from the page's start as an animation.

    Raises
    ------
    RuntimeError
        Without a browser.
    """
    program = browser_found()
    if program is None:
        raise RuntimeError("the film is made by a browser; apt-get install chromium-headless-shell")
    frames = []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        path = Path(folder, "home.html")
        path.write_text(home.page(), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]}, reduced_motion="reduce")
        page.goto(path.as_uri())
        page.evaluate(SET)
        for sample in SAMPLES:
            page.evaluate("k => flightPage.view.show(k)", sample)
            page.evaluate(
                "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
            )
            frames.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
        browser.close()
    first, *others = frames
    first.save(output, save_all=True, append_images=others, duration=FRAME_MS, loop=0, quality=36, method=4)
