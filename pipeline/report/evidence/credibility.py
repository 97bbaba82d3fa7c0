"""The factors of credibility of NASA-STD-7009B, and what a run of the stage `assure` shows for each."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Factor:
    """A factor, what this run shows for it, and what it does not."""

    scale: str
    name: str
    shows: str
    lacks: str


CAPABILITY, RESULTS = "model capability", "results"


def uncertain(conditions: Mapping[str, Any]) -> list[str]:
    """Name what the flights do not know exactly, besides their starts."""
    found = [] if conditions["sun"] == "fixed" else ["Sun"]
    found += [] if conditions["navigation"] == "perfect" else ["errors of navigation"]
    found += [] if conditions["thrusters"] == "ideal" else ["errors of the thrusters"]
    found += [] if conditions["dynamics"] == "cw" else ["forces beyond the controller's model"]
    return found + list(conditions["dispersed"])


def _listed(words: list[str]) -> str:
    *all_but_last, last = ["start", *words]
    return f"{', '.join(all_but_last)} and {last}" if all_but_last else last


def factors(evidence: Mapping[str, Any]) -> list[Factor]:
    """Return all factors; levels are for a reviewer to give, and none is claimed."""
    recorded = [one["worst"] for one in evidence["requirements"] if "worst" in one]
    conditions, domain = evidence["conditions"], evidence["domain"]
    num_cases = conditions["num_cases"]
    searched = sum(one["search"]["num_flights"] for one in evidence["requirements"] if "search" in one)
    boxes = sum(part["num_boxes"] for one in evidence["requirements"] for part in one.get("bounds", ()))
    revision = evidence["git_revision"] or "none (not in a repository)"
    return [
        Factor(
            CAPABILITY,
            "data pedigree",
            "masses, limits and gains are settings of the run, kept in its config.yaml",
            "they are the paper's; no measurement of a spacecraft stands behind them",
        ),
        Factor(
            CAPABILITY,
            "verification",
            f"{len(recorded)} worst flights were flown again, recorded, read back, and judged with the same "
            "margins"
            if recorded
            else "nothing in this run",
            "the product's tests (twins, closed forms, other programs) ran elsewhere, not here",
        ),
        Factor(
            CAPABILITY,
            "validation",
            "nothing",
            "no flight was compared with a real one, or with a model of higher fidelity",
        ),
        Factor(CAPABILITY, "development technical review", "nothing", "reviews are made by people"),
        Factor(
            CAPABILITY,
            "development process and product management",
            f"product {evidence['versions'].get('product')}, source revision {revision}",
            "the development process itself",
        ),
        Factor(
            RESULTS,
            "use assessment",
            "inputs met in flight make the operational domain; "
            f"{domain['num_left']} of {domain['num_tried']} fresh flights leave it"
            if domain
            else "nothing: the controller has no fuzzy inputs",
            "whether that domain is the one of the intended use",
        ),
        Factor(
            RESULTS,
            "input pedigree",
            f"cases are drawn from seed {conditions['seed']}, case by case; requirements and configuration "
            "are hashed",
            "whether starts and Suns are spread as in the intended use",
        ),
        Factor(
            RESULTS,
            "uncertainty characterization",
            f"one-sided binomial bounds over {num_cases:,} cases for {_listed(uncertain(conditions))}",
            "all else is known exactly here: no error of it is flown",
        ),
        Factor(
            RESULTS,
            "results robustness",
            f"{searched:,} flights search for the worst cases; {boxes:,} boxes of inputs prove what systems "
            "can ask for",
            "sensitivity to the controller's own numbers and to the model's",
        ),
        Factor(RESULTS, "use technical review", "nothing", "reviews are made by people"),
        Factor(
            RESULTS,
            "use process and product management",
            "every file of the evidence is hashed, and the command that repeats it is below",
            "who may use the result, and for what",
        ),
    ]
