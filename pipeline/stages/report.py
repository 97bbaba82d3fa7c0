"""Tell a run in pictures, tables and words: report.html and figures/*.png."""

import sys
from pathlib import Path

from pipeline import artifacts
from pipeline.compile_notice import announce_compilation
from pipeline.figures.style import brightness_colours
from pipeline.report.contents import gather
from pipeline.report.page import write
from pipeline.report.pictures import OWN_FILES, draw
from pipeline.settings import Experiment


def run(experiment: Experiment, folder: Path) -> None:
    """Write the report of what is there; pictures of an earlier report that are no longer made go.

    Raises
    ------
    pipeline.artifacts.ArtifactError
        If a file of the run is there and cannot be read.
    """
    announce_compilation()
    contents = gather(experiment, folder)
    illustrations = draw(contents)
    pictures = folder / artifacts.FIGURES
    for name, illustration in illustrations.items():
        artifacts.write_atomically(pictures / f"{name}.png", illustration.png)
    if pictures.is_dir():
        for path in pictures.iterdir():
            if OWN_FILES.fullmatch(path.name) and path.stem not in illustrations:
                path.unlink()
    systems = contents.controller.systems if contents.controller else ()
    counts = {len(system.outputs[0].terms) for system in systems}
    page = write(contents, illustrations, {count: brightness_colours(count) for count in counts})
    artifacts.write_atomically(folder / artifacts.REPORT, page)
    sys.stderr.write(
        f"  {folder / artifacts.REPORT}: {len(illustrations)} pictures, {len(page) / 1e6:.1f} MB\n"
    )
