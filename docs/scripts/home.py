"""The first page, one file with a flight, its rules and its compiled code: ``python -m docs home``."""

import base64
import gzip
import hashlib
import json
import re
from pathlib import Path
from string import Template

from pipeline.command_line.config import compose_experiment
from pipeline.settings.experiment import Experiment

PROJECT = Path(__file__).resolve().parents[2]
FOLDER = PROJECT / "docs" / "flight"
CONTROLLER = "champion_27"
FILE = PROJECT / "conf" / "controller" / f"{CONTROLLER}.yaml"
#: the first is the visitor's own; the others are flown anew whenever a rule is changed
NUM_STARTS = 200
COMMAND = (
    "+experiment=evaluate",
    f"controller={CONTROLLER}",
    "sun=random",
    f"monte_carlo.num_cases={NUM_STARTS}",
)
VIEW = PROJECT / "telemetry" / "page"
PLAYER = PROJECT / "pipeline" / "player"
#: a link to a page of the site
LINK = re.compile(r'href="([\w/.-]+\.html)(?:#[\w-]+)?"')
#: pages of the site that are made elsewhere
AT_ROOT = {"changes": "CHANGELOG.md", "contributing": "CONTRIBUTING.md", "support": "SUPPORT.md"}


def facts() -> list[tuple[str, str, str]]:
    """Return numbers, what each says, and the page with its command; those of flights are README's."""
    kept = PROJECT / "docs" / "results" / "headline.json"
    run = json.loads(kept.read_text(encoding="utf-8"))["comparison"]
    [flown] = [
        row["summary"] for row in run["rows"] if (row["controller"], row["safety"]) == (CONTROLLER, "none")
    ]
    success, fuel = flown["success_and_within_limits"]["fraction"], flown["delta_v_m_s"]["mean"]
    starts, results = f"{run['num_cases']:,} starts", "reference/results.html"
    return [
        (f"{100 * success:.1f} %", f"of {starts} that no training used succeed, the Sun anywhere", results),
        (
            f"{fuel:.3f} m/s",
            "of fuel on average; the paper's controllers burn 5.62, under a Sun that it does not state",
            results,
        ),
        (
            "27 rules",
            "one page of them, in which the audit finds nothing to mend",
            "explanation/champion.html",
        ),
        (
            "0.5 m",
            "proved for another controller, which docks, from all starts of a benchmark",
            "results/field.html#docking",
        ),
    ]


def experiment() -> Experiment:
    """Return what the page flies: the paper's world with the Sun anywhere."""
    return compose_experiment([*COMMAND]).experiment


def page(*, is_alone: bool = False) -> str:
    """Return the page as HTML; alone, not in the site, its links lead to the sources of the pages."""
    from docs.scripts.home_table import table  # noqa: PLC0415 - it reads what is flown from here

    content = table()
    module = base64.b64encode(
        gzip.compress((PLAYER / "modules" / "plain.wasm").read_bytes(), 9, mtime=0)
    ).decode()
    style = "".join(path.read_text(encoding="utf-8") for path in (VIEW / "view.css", FOLDER / "home.css"))
    scripts = PLAYER / "scripts"
    parts = (
        VIEW / "view.js",
        VIEW / "scripts" / "arrays.js",
        scripts / "module.js",
        scripts / "reasons.js",
        FOLDER / "flight.js",
        FOLDER / "home.js",
    )
    code = "".join(path.read_text(encoding="utf-8").replace("\nexport ", "\n") for path in parts)
    # an end tag in a text would end the script
    constants = json.dumps(content, separators=(",", ":")).replace("</", "<\\/")
    script = f'const TABLE = {constants};\nconst MODULE = "{module}";\n{code}'
    template = Template((FOLDER / "home.html").read_text(encoding="utf-8"))
    text = template.substitute(
        SCRIPT=script,
        SCRIPT_HASH=hash_of(script),
        STYLE=style,
        STYLE_HASH=hash_of(style),
        FRAME=(VIEW / "frame.html").read_text(encoding="utf-8"),
        ICON=picture("assets/favicon"),
        MOTION=picture("images/drawings/motion"),
        SLICE=picture("images/drawings/slice_of_rules"),
        NUM_OTHERS=content["num_starts"] - 1,
        FACTS="".join(
            f'<li><a href="{link}"><b>{number}</b></a>{text}</li>' for number, text, link in facts()
        ),
    )
    return LINK.sub(lambda found: f'href="{source_of(found[1])}"', text) if is_alone else text


def source_of(link: str) -> str:
    """Return where the source of a page of the site lies, from the folder of the page alone."""
    name = link.removesuffix(".html")
    return f"../{AT_ROOT[name]}" if name in AT_ROOT else f"../docs/{name}.md"


def picture(name: str) -> str:
    """Return a drawing as an address that holds it, for the page is one file."""
    drawn = (PROJECT / "docs" / f"{name}.svg").read_bytes()
    return f"data:image/svg+xml;base64,{base64.b64encode(drawn).decode()}"


def hash_of(text: str) -> str:
    """Return what the content policy calls a script or style by."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def main() -> None:
    """Write the page, and say where it is."""
    path = PROJECT / "build" / "home.html"
    path.parent.mkdir(exist_ok=True)
    path.write_text(page(is_alone=True), encoding="utf-8")
    print(path.relative_to(PROJECT))


if __name__ == "__main__":
    main()
