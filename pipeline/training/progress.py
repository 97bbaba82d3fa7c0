"""Shows how a training gets on: a bar on a terminal, a line now and then elsewhere."""

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from pipeline.settings.experiment import Experiment
from pipeline.training.evolution.state import Generation

SECONDS_BETWEEN_LINES = 15.0


class TrainingProgress:
    """Best fitness, its parts and the time left, on standard error."""

    def __init__(self, experiment: Experiment) -> None:
        optimizer = experiment.optimizer
        self.total = optimizer.rounds * (optimizer.generations + 1)
        self.per_round = optimizer.generations + 1
        self.console = Console(stderr=True)
        self.bar = Progress(
            TextColumn("  {task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(elapsed_when_finished=False),
            console=self.console,
            disable=not self.console.is_terminal,
        )
        self.task = self.bar.add_task("training", total=self.total)
        self.started = time.perf_counter()
        self.last_line = -SECONDS_BETWEEN_LINES
        self.first_done: int | None = None

    def __enter__(self) -> "TrainingProgress":
        """Start drawing."""
        self.bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop drawing."""
        self.bar.stop()

    def show(self, generation: Generation) -> None:
        """Show a generation that has just been evaluated."""
        parts = generation.parts
        text = (
            f"round {generation.round + 1}, fitness {generation.best:.4g}: "
            f"delta-v {parts['delta_v_m_s']:.3f} m/s, {parts['points']:.2f} points, "
            f"{parts['short']:.0f} short, {parts['outside']:.0f} outside"
        )
        done = generation.round * self.per_round + generation.generation + 1
        if self.console.is_terminal:
            self.bar.update(self.task, completed=done, description=text)
            return
        elapsed = time.perf_counter() - self.started
        if self.first_done is None:
            self.first_done = done - 1
        if elapsed - self.last_line >= SECONDS_BETWEEN_LINES or done == self.total:
            self.last_line = elapsed
            left = elapsed / (done - self.first_done) * (self.total - done)
            sys.stderr.write(f"  generation {done}/{self.total}, {text}, {left:.0f} s left\n")
            sys.stderr.flush()
