"""`review`: one page of everything about a controller, to sign off from."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fis_tools.commands.arguments import AskedAlong, analysing, place_for


def run(
    asked: AskedAlong,
    *,
    evidence: str | None = None,
    output: Annotated[str, Parameter(name=("--output", "-o"))] = "review.html",
) -> None:
    """Write one HTML page to review a controller and sign it off.

    The page is one HTML file that needs no network: what the controller is for, verdicts, its rule tables,
    how often it fails, what is not covered, findings, constants, then each system with an inference whose
    sliders compute in the page what Python computes. Findings are accepted or waived on it, checks ticked, a
    name and a date entered; it saves these as JSON tied to the controller's SHA-256 (that of `python -m
    fis_tools export CONTROLLER --format json`), and prints whole, or a summary. --flights may also be the
    folder of a run: then failures are counted over all flights of its evaluation.

    For example:

        python -m fis_tools review controller.yaml
        python -m fis_tools review outputs/train/TIME --flights outputs/train/TIME
        python -m fis_tools review episodes/best.mcap -o best.html
        python -m fis_tools review controller.yaml --flights RUN --evidence RUN/assure/evidence.json

    Parameters
    ----------
    evidence
        the evidence.json that tells what became of the requirements
    output
        where to
    """
    from fis_tools.review import page  # noqa: PLC0415 - the other commands start without templates

    controller = asked.read()
    print(f"reviewing {controller.name}", file=sys.stderr)
    with analysing(controller):
        text = page.write(controller, asked.paths, asked.system, evidence, all_periods=asked.all_periods)
    path = place_for(Path(output))
    path.write_text(text, encoding="utf-8")
    print(f"{path}: {len(text.encode()) / 1e6:.2f} MB; open it in a browser", file=sys.stderr)
