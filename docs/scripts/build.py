"""Build the site: ``python -m docs build``.

Makes the pages that come from real runs (a champion evaluated, reported and reviewed; a small system
reviewed; the help of every command), then the site, in ``build/site``. Nothing is fetched from a network.
"""

import importlib
import io
import os
import re
import shutil
import subprocess
import sys
from contextlib import redirect_stdout, suppress
from pathlib import Path

from playwright.sync_api import TimeoutError as PlaywrightTimeout
from playwright.sync_api import expect, sync_playwright

from docs.scripts import classics, home, pictures
from docs.scripts.screenshot import browser_found

PROJECT = Path(__file__).resolve().parents[2]
BUILD = PROJECT / "build"
#: what the site takes over, as `docs.scripts.hooks` finds it
MADE = BUILD / "docs"
CHAMPION = ("+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=50")
COMMANDS = ("pipeline", "fis_tools", "telemetry")
#: columns of what commands print
WIDTH = {"COLUMNS": "100"}
#: what readers search for, and the page that must be found first
SEARCHES = {
    "license": "support.html",
    "licence": "support.html",
    "cite": "support.html",
    "Windows": "support.html",
    "delta-v": "reference/results.html",
    "export C": "how-to/exchange-files.html",
    "how long does training take": "how-to/train-a-controller.html",
    "docker": "how-to/run-on-many-machines.html",
}


def main() -> None:
    """Make what is shown, and build the site; leave with the status of ``mkdocs``."""
    run_folder = BUILD / "run"
    for folder in (MADE, run_folder):
        shutil.rmtree(folder, ignore_errors=True)
    (MADE / "live").mkdir(parents=True)
    (MADE / "reference").mkdir()
    printed_by("pipeline", *CHAMPION, f"hydra.run.dir={run_folder}")
    for page in ("report.html", "review.html"):
        shutil.copy(run_folder / page, MADE / "live")
    printed_by(
        "fis_tools", "review", "docs/examples/dimmer.fll", "-o", os.fspath(MADE / "live" / "dimmer.html")
    )
    print("drawing, auditing and reviewing the classic systems", flush=True)
    classics.write(MADE)
    (MADE / "reference" / "commands.md").write_text(commands_page(), encoding="utf-8")
    if changed := pictures.stale():
        print(
            f"what draws these pictures has changed since: python -m docs pictures {' '.join(changed)}",
            flush=True,
        )
    print("building the site", flush=True)
    mkdocs = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    quiet = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    code = subprocess.run(mkdocs, cwd=PROJECT, env=quiet, check=False).returncode  # noqa: S603
    if code == 0:
        write_home(BUILD / "site")
        check_searches(BUILD / "site")
    sys.exit(code)


#: whether the first page that a search finds is one of the site
IS_FIRST = """page => document.querySelector(".md-search-result__item a")
    ?.href.split(/[?#]/)[0].endsWith("/" + page) ?? false"""


def check_searches(site: Path) -> None:
    """Check, in a browser, that the site's search finds first what readers look for; none is no error.

    Raises
    ------
    SystemExit
        Where another page comes first.
    """
    if (program := browser_found()) is None:
        return
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox", "--disable-gpu"])
        # in one tab, since each would index all pages anew
        tab = browser.new_page(viewport={"width": 1400, "height": 900})
        tab.goto((site / "overview.html").as_uri())
        asked, hits = tab.locator(".md-search__input"), tab.locator(".md-search-result__item h1")
        asked.click()
        for words, page in SEARCHES.items():
            asked.fill("")
            expect(hits).to_have_count(0)
            tab.keyboard.type(words)
            try:
                tab.wait_for_function(IS_FIRST, arg=page, timeout=60_000)
            except PlaywrightTimeout:
                first = ", ".join(hits.all_inner_texts()[:3])
                sys.exit(f"a search for {words!r} does not find {page} first, but: {first}")
        browser.close()


def write_home(site: Path) -> None:
    """Write the first page into the site.

    Raises
    ------
    SystemExit
        Where it links to a page that the site does not have.
    """
    text = home.page()
    addresses = re.findall(r'href="(?!data:)([^"]+)"', text.partition("<script")[0])
    links = (link.partition("#")[0] for link in addresses)
    if missing := sorted({link for link in links if not (site / link).is_file()}):
        sys.exit(f"the first page links to pages that the site lacks: {', '.join(missing)}")
    (site / "index.html").write_text(text, encoding="utf-8")


def commands_page() -> str:
    """Return the page of all commands, each with its help."""
    os.environ |= WIDTH
    sections = ["# Commands\n\nWhat each command prints when asked for `--help`.\n"]
    for module in COMMANDS:
        overview = printed_by(module, "--help")
        sections.append(section(f"## python -m {module}", overview))
        listed = overview.partition("─ Commands ─")[2]
        sections += [
            section(f"### {module} {name}", help_of(module, name))
            for name in re.findall(r"^│ (\w+) ", listed, re.MULTILINE)
        ]
    return "\n".join(sections)


def help_of(module: str, command: str) -> str:
    """Return the help of a command, by its function: so many processes would take long."""
    text = io.StringIO()
    with redirect_stdout(text), suppress(SystemExit):
        importlib.import_module(f"{module}.__main__").main([command, "--help"])
    return re.sub(r" +$", "", text.getvalue(), flags=re.MULTILINE)


def section(heading: str, text: str) -> str:
    """Return a heading with a text below it as it was printed."""
    return f"{heading}\n\n```{{.text .help}}\n{text.rstrip()}\n```\n"


def printed_by(*words: str) -> str:
    """Run ``python -m WORDS`` in the root of the repository and return what it prints.

    Raises
    ------
    SystemExit
        Where the command fails; what it said is printed.
    """
    print("python -m", *words, flush=True)
    done = subprocess.run(  # noqa: S603
        [sys.executable, "-m", *words],
        cwd=PROJECT,
        env=os.environ | WIDTH,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
