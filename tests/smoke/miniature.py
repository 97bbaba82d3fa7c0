"""Every experiment of conf/, and the words that run it in miniature."""

from pipeline.command_line.config import compose_experiment
from tests.places import PROJECT

EXPERIMENTS = sorted((PROJECT / "conf" / "experiment").glob("*.yaml"))
#: sizes at which any experiment ends within seconds
MINIATURE = (
    *("optimizer.population_size=6", "optimizer.generations=2", "optimizer.rounds=1"),
    *("assurance.num_cases=3", "assurance.searches=1", "assurance.search_starts=3"),
    *("assurance.search_population=5", "assurance.search_generations=1", "assurance.domain_cases=1"),
    *("optimum.restarts=1", "optimum.kicks=0", "duration_s=600.0", "report.dots_per_inch=50"),
    *("fit.bases=[champion_27]", "fit.draws=1", "fit.cases=[2,3]", "fit.kept=[1]", "fit.num_cases=3"),
    *("fit.goal_percent=40", "fit.neighbours=1", "fit.planners=[]"),  # what plans is not tuned
    "monte_carlo.num_cases=3",
)
#: and with so few kinds of flight that compiling them does, by experiment
FEW = {
    "robustness": ("compare.safety=[none]", "compare.controllers=[lqr]"),
    "reproduce": ("compare.controllers=[paper_champion,champion_27,natural_motion]",),
    "headline": ("compare.controllers=[champion_27,lqr]",),
}


#: of what chooses among champions by further starts, which are thousands
FEWER_STARTS = "optimizer.validation_cases=40"


def words(experiment: str) -> list[str]:
    """The arguments of a run that ends within seconds, but for its folder."""
    small = [*MINIATURE, *FEW.get(experiment, ())]
    if compose_experiment([f"+experiment={experiment}"]).experiment.optimizer.validation_cases:
        small.append(FEWER_STARTS)
    if experiment.startswith("assure"):  # which has flights of its own, judged after an hour
        small = [word for word in small if word not in ("monte_carlo.num_cases=3", "duration_s=600.0")]
    return [f"+experiment={experiment}", *small]
