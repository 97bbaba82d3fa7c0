"""Runs of the command line in miniature, as a person starts them."""

from pathlib import Path

from pipeline.command_line.cli import main
from tests.places import PROJECT

EXPERIMENTS = sorted(path.stem for path in (PROJECT / "conf" / "experiment").glob("*.yaml"))

#: sizes at which any experiment ends within seconds
MINIATURE = (
    *("optimizer.population_size=6", "optimizer.generations=2", "optimizer.rounds=1"),
    *("assurance.num_cases=3", "assurance.searches=1", "assurance.search_starts=3"),
    *("assurance.search_population=5", "assurance.search_generations=1", "assurance.domain_cases=1"),
    *("optimum.restarts=1", "optimum.kicks=0", "duration_s=600.0", "report.dots_per_inch=50"),
    "monte_carlo.num_cases=3",
)
#: and with so few kinds of flight that compiling them does
FEW = {
    "robustness": ("compare.safety=[none]", "compare.controllers=[lqr]"),
    "reproduce": ("compare.controllers=[paper_champion,champion_27,natural_motion]",),
}
NUM_SAMPLES = 61


def run_pipeline(*words: str | Path, folder: Path) -> Path:
    """Run an experiment in this process, which has loaded the kernels, into a folder that it returns."""
    assert main([*map(str, words), f"hydra.run.dir={folder}"]) == 0
    return folder
