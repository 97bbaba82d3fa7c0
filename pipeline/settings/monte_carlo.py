"""The evaluation: from which starts the controller flies, how often, and when flights end."""

from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import checks, start_table, types
from pipeline.settings.checks import SettingError
from pipeline.settings.conditions import Only
from pipeline.settings.groups import Settings
from pipeline.settings.stages import STAGES

#: where the cases of the evaluation count; assurance has its own
EVALUATED = Only(*(f"stages={stage}" for stage in STAGES if stage != "assure"))


class MonteCarlo(Settings, group="monte_carlo"):
    """The evaluation: flights from starts drawn, isotropic and uniform in distance, or from a given table."""

    num_cases: Annotated[types.Cases, EVALUATED] = 1000
    """Flights."""
    only_cases: Annotated[types.CaseRange | None, Only("stages=evaluate")] = None
    """A shard of these flights, [first case, the one after the last], for `merge`; null: all are flown."""
    stop_width: Annotated[types.Positive | None, Only("stages=evaluate")] = None
    """Width of the interval of stop_quantity at which flights end, at most num_cases; null: all are flown."""
    stop_quantity: Annotated[
        Literal["success_and_within_limits", "violated", "delta_v_m_s"], Only("monte_carlo.stop_width")
    ] = "success_and_within_limits"
    """Whose interval is to be so narrow: a share of the flights, or the mean delta-v (m/s)."""
    splitting_flights: Annotated[types.Natural, Only("stages=evaluate")] = 0
    """Further flights that tell by splitting how rarely one leaves the limits; 0: none."""
    min_distance_m: Annotated[types.Positive, types.Follows()] = 50.0
    """Least distance of a start from the chief; null: 50, or what fits the limits and the camera."""
    max_distance_m: Annotated[types.Number, types.Follows()] = 100.0
    """Greatest distance of a start from the chief; null: 100, or what fits the limits and the camera."""
    confidence_percent: Annotated[types.Number, Field(ge=80, le=99.99)] = 95.0
    """Confidence of the intervals in the summary."""
    workers: types.Workers = None
    """Threads that fly; null: one a processor."""
    max_speed_m_s: Annotated[types.NotNegative, Field(le=100)] = 0.0
    """Greatest speed of a start, in any direction; 0: rest."""
    directions: Literal["even", "angles"] = "even"
    """Directions of starts and speeds: even on the sphere, or by even angles, denser at the poles (AFRL)."""
    box: types.Box | None = None
    """Least and greatest x, y, z, x', y', z' of starts drawn evenly between them; null: the shell."""
    parked: types.Flag = False
    """Whether starts move along the track by -2 n x instead of being at rest: on closed ellipses."""
    table: Annotated[types.Text | None, Only("starts.kind=file")] = None
    """Starts in place of drawn ones, as CSV text."""

    def __post_init__(self) -> None:
        """Check that the shell's bounds ascend, and that starts have one velocity."""
        others = (self.max_speed_m_s > 0.0, self.box is not None, self.table is not None)
        for key, is_given in zip(("max_speed_m_s", "box", "table"), others, strict=True):
            if self.parked and is_given:
                raise SettingError(
                    f"monte_carlo.parked is true, and monte_carlo.{key} gives starts other velocities; "
                    "leave one of them out"
                )
        checks.shell("monte_carlo", self.min_distance_m, self.max_distance_m)
        start_table.check_count("monte_carlo", self.num_cases, self.table)
        if self.only_cases is not None and self.only_cases[1] > self.num_cases:
            raise SettingError(
                f"monte_carlo.only_cases ends at {self.only_cases[1]}, and monte_carlo.num_cases is "
                f"{self.num_cases}, of the whole campaign; raise that, or end earlier"
            )
        if self.only_cases is not None and self.stop_width is not None:
            raise SettingError(
                "monte_carlo.only_cases and monte_carlo.stop_width are given; where the whole would stop, a "
                "shard of it does not know: leave one out"
            )
        if self.splitting_flights and self.table is not None:
            raise SettingError(
                "monte_carlo.splitting_flights is given, and so are the starts; splitting chooses its starts "
                "itself: leave one out"
            )

    @property
    def cases(self) -> range:
        """The numbers of the cases to fly."""
        return range(*(self.only_cases or (0, self.num_cases)))
