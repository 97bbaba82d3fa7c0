"""`firing`: which rules fired along logged flights."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from fis_tools.analysis import arrays
from fis_tools.analysis import flights as logged
from fis_tools.commands.arguments import UserMistake, chosen, expected, flown_inputs
from fis_tools.document import Block, Document, Heading, Paragraph, Table, text
from fis_tools.model import FuzzyController, FuzzySystem
from fis_tools.source import read_controller
from fis_tools.words.text import sentence


def run(
    flights: tuple[str, ...],
    /,
    *,
    controller: str | None = None,
    trust: bool = False,
    system: str | None = None,
    threshold: Annotated[
        float, expected("a strength above 0 and up to 1, such as 0.05", lambda share: 0.0 < share <= 1.0)
    ] = arrays.FIRED,
    all_periods: bool = False,
) -> None:
    """Print which rules fired along logged flights, those that fired most often first.

    Counted are the rows of tables, and along flights the inferences whose force was fired; with
    --all-periods, all that were logged. Flights carry their controller along, tables do not. Fired: in how
    many of them the rule fired at the threshold or more; leading: in how many no rule fired more strongly;
    mean, max: its strength over all of them.

    For example:

        python -m fis_tools firing episodes/*.mcap
        python -m fis_tools firing episodes/best.mcap --system force_x --threshold 0.2
        python -m fis_tools firing room.csv --controller fan.yaml

    Parameters
    ----------
    flights
        logged data of one controller: tables (.csv, .parquet) with a column for each input, by its name, or
        flights (.mcap)
    controller
        whose rules [default: those of the flights]
    trust
        run the Python program that a controller is read from
    system
        only this system
    threshold
        a rule counts as fired from this strength on
    all_periods
        along flights, count every inference, not only those whose force was fired
    """
    if controller is None:
        tables = [path for path in flights if not logged.is_flight(path)]
        if tables:
            raise UserMistake(f"{tables[0]} is no flight (.mcap) with a controller in it; add --controller")
        usages = logged.usage_along(flights, threshold, all_periods)
        asked = chosen(logged.read_controller(flights[0]), system)
    else:
        asked = chosen(read_controller(controller, trust), system)
        usages = _used(asked, flights, threshold, all_periods)
    blocks = [block for one in asked.systems for block in _blocks(one, usages.get(one.name), threshold)]
    print(text.write(Document(blocks)), end="")


def _used(
    controller: FuzzyController, flights: Sequence[str], threshold: float, all_periods: bool
) -> dict[str, arrays.RuleUsage]:
    """Return how the rules of a controller fired along flights of another, or over tables."""
    sensed = flown_inputs(flights, controller, all_periods) or {}
    return {
        system.name: arrays.rule_usage(arrays.firing(system, sensed[system.name]), threshold)
        for system in controller.systems
        if len(sensed.get(system.name, ()))
    }


def _blocks(system: FuzzySystem, usage: arrays.RuleUsage | None, threshold: float) -> list[Block]:
    if usage is None:
        return [Heading(system.name), Paragraph("It never fired anything on these flights.")]
    idle = int(np.count_nonzero(usage.fired == 0))
    rows = [
        [
            *(f"{100 * share[place]:.1f} %" for share in (usage.fired, usage.leading)),
            *(f"{strength[place]:.2f}" for strength in (usage.mean_strength, usage.max_strength)),
            f"{place + 1}. {sentence(system.rules[place])}",
        ]
        for place in np.argsort(-usage.fired, kind="stable")
    ]
    head = (
        f"{system.name}: {usage.num_samples} inferences; {idle} of {len(system.rules)} rules never fire "
        f"at {threshold:g} or more"
    )
    return [Heading(head), Table(["fired", "leading", "mean", "max", "rule"], rows, numbers=range(4))]
