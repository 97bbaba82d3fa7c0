"""Make the pictures of the pages anew: ``python -m docs pictures [NAME ...]``, such as ``safety tour``.

Without names all of them are made, in about a quarter of an hour: flown, trained, recorded and drawn by the
commands that stand in this file. What is drawn by rerun's viewer needs a Vulkan driver, a page a browser.

``pictures.json`` holds a hash of what each was drawn by; the site's build names those for which it changed.
"""

import hashlib
import inspect
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

from docs.scripts import film
from docs.scripts.screenshot import browser_found, screenshot
from pipeline.command_line.endings import OK, UNIMPROVED
from pipeline.report.figures.comparison import ControllerMark, compared
from pipeline.report.figures.style import save, style

PROJECT = Path(__file__).resolve().parents[2]
IMAGES = PROJECT / "docs" / "images"
HASHES = Path(__file__).with_suffix(".json")
FIELD, RESULTS = "docs/results/field.md", "docs/reference/results.md"
ROWS = "docs/results/leaderboard.json"


def flight(_: Path) -> None:
    """Film the flight of the first page."""
    film.film(IMAGES / "flight.webp")


def replay(scratch: Path) -> None:
    """Draw a replayed flight after 1, 17 and 50 minutes."""
    ran = run(scratch, "+experiment=fly", "controller=champion_27")
    times = (60, 1020, 3000)
    viewed(scratch, "--at", *times, of=ran / "episodes" / "start.mcap")
    for time_s in times:
        keep(scratch / "pictures" / f"replay-{time_s}.png")


def satellite(scratch: Path) -> None:
    """Draw a chief of parts, lit and seen."""
    ran = run(scratch, "+experiment=fly", "controller=champion_any_sun", "light=shadow", "chief=satellite")
    viewed(scratch, "--at", 480, of=ran / "episodes" / "start.mcap")
    # what the viewer draws of the scene and of what the camera sees: left, top, right, bottom
    scene = (0, 56, 822, 484)
    with Image.open(scratch / "pictures" / "replay-480.png") as drawn:
        drawn.crop(scene).save(IMAGES / "satellite.png")


def campaign(scratch: Path) -> None:
    """Draw 1,000 evaluated flights."""
    viewed(scratch, of=run(scratch, "+experiment=evaluate", "controller=paper_champion"))
    keep(scratch / "pictures" / "campaign.png")


def comparison(_: Path) -> None:
    """Draw the tables of all controllers, delta-v against rate."""
    page, measure = (PROJECT / RESULTS).read_text(encoding="utf-8"), r"([\d.]+) ± ([\d.]+)"
    row = re.compile(rf"^\| (.+?) \| *\d* *\| {measure}(?: \[.+?\])? \| {measure} \|", re.MULTILINE)
    panels = []
    for sun in ("Sun fixed", "Sun anywhere"):
        table = page.partition(f"| {sun} |")[2].partition("\n\n")[0]
        marks = [
            ControllerMark(re.sub(r".*`(\w+)`", r"\1", name), *zip(*[map(float, numbers)] * 2, strict=True))
            for name, *numbers in row.findall(table)
        ]
        panels.append((sun, marks))
    with style():
        figure = compared(panels, 95.0)
    (IMAGES / "comparison.png").write_bytes(save(figure, "comparison", 150).png)


def field(_: Path) -> None:
    """Draw three tables of the page on the field's worlds, up to 3 m/s, bsk_rl's up to 12."""
    page, number = (PROJECT / FIELD).read_text(encoding="utf-8"), r"([\d.]+)"
    row = re.compile(rf"^\| (.+) \| .+ \| {number} \(.+\) \| {number} % .+ \| .+ \| .+ \|$", re.MULTILINE)
    panels = []
    for world, most in (("afrl", 3.0), ("afrl_weighted", 3.0), ("rso", 12.0)):
        table = page.partition(f"`world={world}`, 1,000 starts")[2].partition("`world=")[0]
        marks = [
            ControllerMark(re.sub(r"`|, \d+ starts$", "", name), (float(mean), 0.0), (float(share), 0.0))
            for name, mean, share in row.findall(table)
            if 0.0 < float(mean) < most
        ]
        panels.append((f"world={world}", marks))
    with style():
        figure = compared(panels, 0.0, ((0.06, 13.0), (118.0, 0.22)))
        figure.axes[0].set_ylabel("success as its authors count (%)")
    (IMAGES / "field.png").write_bytes(save(figure, "field", 150).png)


def leaderboard(_: Path) -> None:
    """Draw what trainings of the leaderboard come to with time, from the rows that are kept."""
    words = ("leaderboard", "--seeds", 0, "--cases", 300, "-c", "lqr", "--rows", ROWS)
    python("benchmarks", *words, "--picture", IMAGES / "leaderboard.png")


def front(scratch: Path) -> None:
    """Draw a front of controllers."""
    # the given controller may be better than the best of the front
    words = "+experiment=train_front", "stages=[scenario,train,report]", "optimizer.rounds=2"
    keep(run(scratch, *words, codes=(OK, UNIMPROVED)) / "figures" / "front.png")


def safety(scratch: Path) -> None:
    """Draw a flight with the safety layer and without."""
    # one of the flights that leave the outer limit without the layer
    words = ("controller=paper_octants", "safety=filter", "safety.keep_in_horizon_s=450")
    keep(run(scratch, "+experiment=evaluate", *words) / "figures" / "safety.png")


def tour(scratch: Path) -> None:
    """Draw six flights of the low orbit's champion."""
    python(
        "benchmarks.champion",
        "champion_leo",
        "--world",
        "leo",
        "--flights",
        6,
        "--picture",
        scratch / "tour.png",
    )
    keep(scratch / "tour.png")


def review(scratch: Path) -> None:
    """Draw the review page: one inference, and the rules along a flight."""
    ran = run(scratch, "+experiment=fly", "controller=champion_27")
    recording, page = ran / "episodes" / "start.mcap", scratch / "review.html"
    python("fis_tools", "review", "conf/controller/champion_27.yaml", "--flights", recording, "-o", page)
    screenshot(page, "One inference, step by step", IMAGES / "review.png", 1180, 1155)


def edit(scratch: Path) -> None:
    """Draw the editor with a rule turned: what many flights came to, and one that changed most."""
    words = ("pipeline", "edit", "controller=champion_27", "sun=random", "--no-browser")
    command = [sys.executable, "-m", *words]
    with subprocess.Popen(command, cwd=PROJECT, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603
        try:
            edited((server.stdout or sys.stdin).readline().strip())
        finally:
            server.terminate()


def settle(page: Page) -> None:
    """Wait until no panel of the editor computes, and all is drawn."""
    page.wait_for_timeout(1000)
    shown = "() => ![...document.querySelectorAll('.state')].some((one) => one.innerText)"
    page.wait_for_function(shown, timeout=300_000)
    page.wait_for_timeout(2000)


def edited(address: str) -> None:
    """Turn a rule on the editor's page, and draw what comes of it."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_found(), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800}, device_scale_factor=1.25)
        page.goto(address)
        page.add_style_tag(content=".head { position: static !important; }")
        page.get_by_label("rule 2:").click()
        flights, flight = (page.get_by_role("region", name=name) for name in ("Flights", "One flight"))
        flights.get_by_text("1,000 flights").wait_for(timeout=300_000)
        settle(page)
        page.screenshot(path=IMAGES / "edit-flights.png")
        page.get_by_role("button").filter(has_text="m/s,").first.click()
        settle(page)
        flight.get_by_role("slider").fill("120")
        settle(page)
        flight.screenshot(path=IMAGES / "edit-flight.png")
        browser.close()


MAKERS: dict[str, Callable[[Path], None]] = {
    maker.__name__: maker
    for maker in (
        *(flight, replay, satellite, campaign, comparison),
        *(field, leaderboard, front, safety, tour, review, edit),
    )
}
SCENE, FIGURES, CONTROLLERS = "telemetry/scene", "pipeline/report/figures", "conf/controller"
#: files and folders that draw a picture, beside its maker, or that it shows
SOURCES: dict[str, tuple[str, ...]] = {
    "flight": ("docs/scripts/film.py", f"{CONTROLLERS}/champion_27.yaml"),
    "replay": (SCENE, f"{CONTROLLERS}/champion_27.yaml"),
    "satellite": (SCENE, f"{CONTROLLERS}/champion_any_sun.yaml"),
    "campaign": (SCENE, f"{CONTROLLERS}/paper_champion.yaml"),
    "comparison": (f"{FIGURES}/comparison.py", f"{FIGURES}/style.py", RESULTS),
    "field": (f"{FIGURES}/comparison.py", f"{FIGURES}/style.py", FIELD),
    "leaderboard": ("benchmarks/curves.py", f"{FIGURES}/style.py", ROWS),
    "front": (f"{FIGURES}/comparison.py", f"{FIGURES}/style.py", "conf/optimizer/front.yaml"),
    "safety": (f"{FIGURES}/trajectories.py", f"{FIGURES}/style.py", f"{CONTROLLERS}/paper_octants.yaml"),
    "tour": ("benchmarks/champion.py", f"{FIGURES}/trajectories.py", f"{CONTROLLERS}/champion_leo.yaml"),
    "edit": ("fis_tools/edit", "pipeline/edit", "telemetry/page", f"{CONTROLLERS}/champion_27.yaml"),
    "review": ("fis_tools/review", f"{CONTROLLERS}/champion_27.yaml"),
}


def drawn_by(name: str) -> str:
    """Return the SHA-256 of what a picture is drawn by: its maker, and the files of its sources."""
    digest = hashlib.sha256(inspect.getsource(MAKERS[name]).encode())
    for source in SOURCES[name]:
        source_path = PROJECT / source
        for path in [source_path] if source_path.is_file() else sorted(source_path.rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                digest.update(path.read_bytes())
    return digest.hexdigest()


def stale() -> list[str]:
    """Return the pictures for which this changed since they were drawn."""
    kept = json.loads(HASHES.read_text(encoding="utf-8"))
    return [name for name in MAKERS if kept.get(name) != drawn_by(name)]


def run(scratch: Path, *words: str, codes: Sequence[int] = (OK,)) -> Path:
    """Run the pipeline, which must end with one of some codes; return the folder of the run."""
    python("pipeline", *words, f"hydra.run.dir={scratch / 'run'}", codes=codes)
    return scratch / "run"


def viewed(scratch: Path, *words: object, of: Path) -> None:
    """Draw a flight or a run by the viewer, into ``pictures``."""
    python("telemetry", "screenshot", of, *words, "-o", scratch / "pictures")


def python(module: str, *words: object, codes: Sequence[int] = (OK,)) -> None:
    """Run a module as a command of the project."""
    command = [sys.executable, "-m", module, *map(str, words)]
    ended = subprocess.run(command, cwd=PROJECT, check=False, stdout=subprocess.DEVNULL)  # noqa: S603
    if ended.returncode not in codes:
        ended.check_returncode()


def keep(drawn: Path) -> None:
    """Put a picture among those of the pages."""
    shutil.copy(drawn, IMAGES)


def main(names: Sequence[str]) -> None:
    """Make the pictures of these names, or all."""
    unknown = set(names) - MAKERS.keys()
    if unknown:
        sys.exit(f"There is no picture {', '.join(sorted(unknown))}; choose some of: {', '.join(MAKERS)}")
    for name in names or MAKERS:
        print(f"drawing {name}", flush=True)
        with tempfile.TemporaryDirectory() as scratch:
            MAKERS[name](Path(scratch))
        kept = json.loads(HASHES.read_text(encoding="utf-8")) | {name: drawn_by(name)}
        HASHES.write_text(json.dumps(kept, indent=2, sort_keys=True) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
