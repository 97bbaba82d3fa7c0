"""The page of classic systems: each drawn, audited and reviewed from its file when the site is built."""

from collections.abc import Iterator
from pathlib import Path

from fis_tools import render
from fis_tools.findings.audit import Audit, audit, report
from fis_tools.model import FuzzyController
from fis_tools.review import page
from fis_tools.source import read_controller
from fis_tools.words.text import sentences, summary

EXAMPLES = Path(__file__).parents[1] / "examples"
#: rule bases of fewer are listed
MOST_RULES = 10
#: what a file of MATLAB has no place for
TIPPER = "MathWorks, Fuzzy Logic Toolbox, the tipping problem (tipper.fis)"
INTRODUCTION = """\
# Ten classic systems

Systems with which textbooks, standards and manuals teach fuzzy control, rewritten from their definitions.
Where a source leaves numbers open, we chose them and say so. Each has its file, the surface of its first
output, the audit's findings, and its page to sign off from, all made from the files when this site was
built. `python -m fis_tools review docs/examples/classics/pendulum.yaml` makes one page.

"""


def paths() -> list[Path]:
    """Return the files, in the order of the page."""
    return [EXAMPLES / "tipper.fis", *sorted((EXAMPLES / "classics").glob("*.yaml"))]


def write(folder: Path) -> None:
    """Write ``classics.md``, and its pictures and review pages beside it, into ``live/classics``."""
    live = folder / "live" / "classics"
    live.mkdir(parents=True, exist_ok=True)
    audits, sections = [], []
    for path in paths():
        controller = read_controller(path)
        audits.append(audit(controller))
        sections += section(path, controller, audits[-1])
        (live / f"{path.stem}.html").write_text(page.write(controller), encoding="utf-8")
        _, figure = next(iter(render.surface_figures(controller.systems[0])))
        render.save(figure, live / f"{path.stem}.png")
    text = INTRODUCTION + "\n".join([*measures(audits), *sections]) + "\n"
    (folder / "classics.md").write_text(text, encoding="utf-8")


def section(path: Path, controller: FuzzyController, findings: Audit) -> Iterator[str]:
    """Yield the lines about one system."""
    system = controller.systems[0]
    source, live = path.relative_to(EXAMPLES.parent).as_posix(), f"live/classics/{path.stem}"
    yield f"## {words_of(path.stem).capitalize()}\n"
    yield f"{dict(controller.provenance).get('source', TIPPER)}.\n"
    yield f"{summary(system)}. [The page to sign off from]({live}.html), [the file]({source}).\n"
    if len(system.rules) < MOST_RULES:
        yield "\n".join(f"{number}. {rule}" for number, rule in enumerate(sentences(system), start=1)) + "\n"
    yield f"![{system.outputs[0].name} over its inputs]({live}.png){{ width=480 }}\n"
    if not findings.findings:
        yield "The audit finds nothing.\n"
        return
    yield "| severity | what the audit finds | what to do |\n|---|---|---|"
    for finding in findings.findings:
        yield f"| {finding.severity.word} | {finding.sentence} | {finding.cure} |"
    yield ""


def measures(audits: list[Audit]) -> Iterator[str]:
    """Yield what was measured of all, a row each, and what the measures mean."""
    heads = ("system", "rules", "completeness", "rule consistency")
    yield f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}"
    for audited in audits:
        (system,) = audited.systems
        of = system.measures
        measured = (of.completeness.least, of.rule_consistency.index)
        cells = (words_of(system.name), str(of.complexity.rules), *(f"{number:.2f}" for number in measured))
        yield f"| {' | '.join(cells)} |"
    yield "\n" + "\n".join(f"- {words}" for words in report.MEASURE_WORDS) + "\n"


def words_of(name: str) -> str:
    """Return a name in words."""
    return name.replace("_", " ")
