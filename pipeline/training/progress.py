"""Shows the progress of a training: the best fitness and its parts."""

from pipeline.run.progress import Progress
from pipeline.settings.experiment import Optimizer
from pipeline.training.evolution.state import Generation


class TrainingProgress(Progress):
    """The generations of all rounds, each with its first population."""

    def __init__(self, settings: Optimizer) -> None:
        self._per_round = settings.generations + 1
        super().__init__("generation", settings.rounds * self._per_round)

    def show_generation(self, generation: Generation) -> None:
        """Show a generation that has just been evaluated."""
        parts = generation.parts
        self.show(
            generation.round * self._per_round + generation.generation + 1,
            f"round {generation.round + 1}, fitness {generation.best:.4g}: "
            f"delta-v {parts['delta_v_m_s']:.3f} m/s, {parts['points']:.2f} points, "
            f"{parts['short']:.0f} short, {parts['outside']:.0f} outside",
        )
