"""What follows the hour: ``python -m benchmarks after [CONTROLLER...] [key=value...]`` coasts on.

For each controller it prints how many flights succeed, how many then stay inside the limits without force,
and how many were never where a failure of all thrusters would lead to the chief within an orbit.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.controllers import source
from pipeline.evaluation.after import aftermath, stays
from pipeline.evaluation.monte_carlo import fly_tracked
from pipeline.evaluation.statistics import fraction
from pipeline.flight.world.coasting import FreeMotion
from pipeline.scenarios import evaluation_scenarios

#: after the flight's end
MINUTES = (5, 10, 20)
#: of a track: position and velocity
STATE = slice(0, 6)


def main(arguments: Sequence[str]) -> int:
    """Print a Markdown table, a line for each controller."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks after", description=__doc__)
    parser.add_argument(
        "words", nargs="*", help="controllers; all of +experiment=reproduce unless given; keys"
    )
    parser.add_argument("--cases", type=int, default=300, help="flights of each controller")
    parser.add_argument("--seed", type=int, default=101, help="of the starts")
    options = parser.parse_args(arguments)
    changes = [word for word in options.words if "=" in word]
    reproduced = compose_experiment(["+experiment=reproduce"]).experiment.compare.controllers
    names = [word for word in options.words if "=" not in word] or list(reproduced)
    heads = [f"stays {minutes} min" for minutes in MINUTES] + ["stays an orbit", "stays three orbits"]
    print(f"| controller | delta-v (m/s) | success | {' | '.join(heads)} | passively safe |")
    print("|---|---|---|" + "---|" * (len(heads) + 1))
    for name in names:
        words = [f"seed={options.seed}", f"monte_carlo.num_cases={options.cases}", "sun=random", *changes]
        experiment = compose_experiment(["+experiment=evaluate", *words]).experiment
        mission = experiment.mission
        flown, tracks = fly_tracked(
            mission, source.named(name, mission), evaluation_scenarios(experiment), None
        )
        shares = [flown.is_success(mission.inspection_threshold_percent) & ~flown.is_violated]
        motion, ends = FreeMotion(mission, 60.0 * MINUTES[-1]), tracks[:, -1, STATE].astype(np.float64)
        shares += [stays(mission, motion, ends, 60.0 * minutes) for minutes in MINUTES]
        shares += aftermath(mission, tracks) or []
        cells = [share_in_words(share) for share in shares]
        print(f"| `{name}` | {flown.delta_v_m_s.mean():.3f} | {' | '.join(cells)} |", flush=True)
    return 0


def share_in_words(is_so: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> str:
    """Return a share of flights in per cent, with its 95 % interval."""
    share = fraction(is_so, 95.0)
    return f"{100 * share.fraction:.1f} % ({100 * share.low:.1f}–{100 * share.high:.1f})"
