"""The tables of evidence: one row per case, per flight of a search, or per side of a box."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.evaluation.assurance.campaign import Outcome
from pipeline.evaluation.assurance.search import Search
from pipeline.evaluation.assurance.verdicts import Found
from pipeline.flight.cases.dispersions import drawn
from pipeline.flight.state.log import Scenario
from pipeline.settings.experiment import Mission

Columns = dict[str, NDArray[Any]]


def of_cases(mission: Mission, scenarios: Sequence[Scenario], outcomes: Mapping[str, Outcome]) -> Columns:
    """Return the columns of `assure/cases.parquet`: starts, each requirement's margin, whether it is met.

    Each dispersed setting has a column, named after its key.
    """
    judged = {
        f"{name}_{what}": values
        for name, outcome in outcomes.items()
        for what, values in (("margin", outcome.margins), ("met", outcome.is_met))
    }
    return {"case": np.arange(len(scenarios)), **_starts(mission, scenarios), **judged}


def of_searches(mission: Mission, found: Sequence[Found]) -> Columns:
    """Return the columns of `assure/search.parquet`: every flight of every search; none without a search."""
    flown: list[tuple[str, int, Search]] = [
        (one.requirement.id, number, search) for one in found for number, search in enumerate(one.searches)
    ]
    if not flown:
        return {}
    counts = [len(one.scenarios) for _, _, one in flown]
    return {
        "requirement": np.repeat([name for name, _, _ in flown], counts),
        "search": np.repeat([number for _, number, _ in flown], counts),
        "flight": np.concatenate([np.arange(count) for count in counts]),
        **_starts(mission, [scenario for _, _, one in flown for scenario in one.scenarios]),
        "margin": np.concatenate([one.outcome.margins for _, _, one in flown]),
        "met": np.concatenate([one.outcome.is_met for _, _, one in flown]),
    }


def of_boxes(found: Sequence[Found]) -> Columns:
    """Return the columns of `assure/boxes.parquet`: a row for each input of each box of each certificate."""
    rows = [
        (one.requirement.id, proof.system, proof.question.ask, box, name, low[place], high[place])
        for one in found
        for proof in one.certificates
        for box, (low, high) in enumerate(zip(proof.low, proof.high, strict=True))
        for place, name in enumerate(proof.inputs)
    ]
    names = ("requirement", "system", "ask", "box", "input", "low", "high")
    return {name: np.array([row[place] for row in rows]) for place, name in enumerate(names)} if rows else {}


def _starts(mission: Mission, scenarios: Sequence[Scenario]) -> Columns:
    own = [dict(drawn(mission, one)) for one in scenarios] if mission.dispersions else []
    positions = np.array([one.position_m for one in scenarios])
    return {
        **{f"position_{axis}_m": positions[:, n] for n, axis in enumerate("xyz")},
        "sun_angle_rad": np.array([one.sun_angle_rad for one in scenarios]),
        "sun_elevation_rad": np.array([one.sun_elevation_rad for one in scenarios]),
        **{key: np.array([of[key] for of in own]) for key in (own[0] if own else ())},
    }
