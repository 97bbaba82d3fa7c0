"""Write the report of a run: report.html and figures/*.png; the review of its controller: review.html."""

import sys
from pathlib import Path

from fis_tools.errors import ControllerFileError
from fis_tools.review import page as review
from pipeline.report.contents import Contents, gather
from pipeline.report.page import write
from pipeline.report.pictures import OWN_FILES, draw
from pipeline.report.played import player_of_run
from pipeline.run import artifacts, writing
from pipeline.settings.experiment import Experiment
from plain_files.document.html import ScriptedPanel


def run(experiment: Experiment, folder: Path) -> None:
    """Write the report of what is there; pictures of an earlier report that are not made again are removed.

    Raises
    ------
    pipeline.run.artifacts.ArtifactError
        If a file of the run exists and cannot be read.
    """
    contents = gather(experiment, folder)
    player = player_of_run(contents)
    _write_review(contents, folder, player)
    illustrations = {illustration.name: illustration for illustration in draw(contents)}
    pictures = folder / artifacts.FIGURES
    for name, illustration in illustrations.items():
        writing.write_atomically(pictures / f"{name}.png", illustration.png)
    for path in pictures.glob("*.png"):
        if OWN_FILES.fullmatch(path.name) and path.stem not in illustrations:
            path.unlink()
    page = write(contents, illustrations, player)
    writing.write_atomically(folder / artifacts.REPORT, page)
    sys.stderr.write(
        f"  {folder / artifacts.REPORT}: {len(illustrations)} pictures, {len(page) / 1e6:.1f} MB\n"
    )


def _write_review(contents: Contents, folder: Path, player: ScriptedPanel | None) -> None:
    """Write the review of the run's fuzzy controller; an earlier one is removed."""
    path = folder / artifacts.REVIEW
    fuzzy = contents.controller.fuzzy if contents.controller else None
    if fuzzy is None:
        path.unlink(missing_ok=True)
        return
    try:
        recordings = [folder / name for name in contents.recordings]
        page = review.write(fuzzy, recordings, panel=player)
    except ControllerFileError as error:
        raise artifacts.ArtifactError(f"{error}; repeat the stage record") from error
    writing.write_atomically(path, page)
    sys.stderr.write(f"  {path}: {len(page) / 1e6:.1f} MB\n")
