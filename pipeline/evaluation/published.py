"""The paper's results: Choi, Kim and Leeghim, AAS 25-727, summaries of its training and test results."""

from dataclasses import dataclass

SOURCE = "Choi, Kim and Leeghim, AAS 25-727"


@dataclass(frozen=True)
class Reported:
    """A row of the paper: means and standard deviations, by the names in our summaries."""

    label: str
    num_cases: int
    means: dict[str, float]
    standard_deviations: dict[str, float]


TRAINING = Reported(
    "training",
    8,
    {"delta_v_m_s": 4.799, "inspection_rate_percent": 99.748, "mean_distance_m": 67.030},
    {"delta_v_m_s": 0.458, "inspection_rate_percent": 0.468, "mean_distance_m": 1.280},
)
TEST = Reported(
    "test",
    1000,
    {"delta_v_m_s": 5.62, "inspection_rate_percent": 96.667, "mean_distance_m": 66.629},
    {"delta_v_m_s": 0.715, "inspection_rate_percent": 3.919, "mean_distance_m": 1.039},
)
