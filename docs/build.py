"""Build the site: ``python -m docs.build``.

Makes the pages that come from real runs (a champion evaluated, reported and reviewed; a small system
reviewed; the help of every command), then the site, in ``build/site``. Nothing is fetched from a network.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from docs import classics, home, pictures

PROJECT = Path(__file__).resolve().parents[1]
BUILD = PROJECT / "build"
#: what the site takes over, as `docs.hooks` finds it
MADE = BUILD / "docs"
CHAMPION = ("+experiment=evaluate", "controller=champion_27", "sun=random", "monte_carlo.num_cases=50")
COMMANDS = ("pipeline", "fis_tools", "telemetry")
#: what readers search for, and the page that must answer
SEARCHES = {
    "licence": "support.html",
    "cite": "support.html",
    "Windows": "support.html",
    "delta-v": "reference/results.html",
    "export C": "how-to/run-in-a-simulator.html",
    "how long does training take": "how-to/train-a-controller.html",
    "docker": "how-to/run-in-a-container.html",
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
            f"what draws these pictures has changed since: python -m docs.pictures {' '.join(changed)}",
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


def check_searches(site: Path) -> None:
    """Check that the search knows every word of what readers look for on the page that answers.

    Raises
    ------
    SystemExit
        Where a page lacks one.
    """
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))["docs"]
    for words, page in SEARCHES.items():
        parts = (f"{part['title']} {part['text']}" for part in index if part["location"].startswith(page))
        text = " ".join(parts).lower()
        if missing := [
            word for word in words.lower().split() if not re.search(rf"\b{re.escape(word)}\b", text)
        ]:
            sys.exit(f"a search for {words!r} misses {page}: no {', '.join(missing)} there")


def write_home(site: Path) -> None:
    """Write the first page into the site.

    Raises
    ------
    SystemExit
        Where it links to a page that the site does not have.
    """
    text = home.page()
    links = (link.partition("#")[0] for link in re.findall(r'href="([^"]+)"', text.partition("<script")[0]))
    if missing := sorted({link for link in links if not (site / link).is_file()}):
        sys.exit(f"the first page links to pages that the site lacks: {', '.join(missing)}")
    (site / "index.html").write_text(text, encoding="utf-8")


def commands_page() -> str:
    """Return the page of all commands, each with its help."""
    sections = ["# Commands\n\nWhat each command prints when asked for `--help`.\n"]
    for module in COMMANDS:
        overview = printed_by(module, "--help")
        sections.append(section(f"## python -m {module}", overview))
        listed = overview.partition("  COMMAND\n")[2].partition("\n\n")[0]
        for name in re.findall(r"^    (\w+)", listed, re.MULTILINE):
            sections.append(section(f"### {module} {name}", printed_by(module, name, "--help")))
    return "\n".join(sections)


def section(heading: str, text: str) -> str:
    """Return a heading with a text below it as it was printed."""
    return f"{heading}\n\n```text\n{text.rstrip()}\n```\n"


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
        env=os.environ | {"COLUMNS": "100"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main()
