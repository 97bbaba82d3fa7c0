"""A verdict in a sentence: for which share, how surely, what flights did, what a failure means."""

from pipeline.evaluation.assurance.formula import Always, Comparison, Eventually
from pipeline.evaluation.assurance.quantities import QUANTITIES
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.assurance.verdicts import Found, Outcome, percent


def share(requirement: Requirement, judged: Outcome) -> str:
    """Say for what share of the cases, and how surely, a requirement is claimed or proved."""
    if judged.is_proof:
        return "all cases (proved)" if requirement.formula else "all inputs (proved)"
    if requirement.formula is None:
        return "all inputs"
    if requirement.probability == 1.0:
        return "all cases"
    return (
        f"{percent(requirement.probability)} of cases or more ({percent(requirement.confidence)} confidence)"
    )


def sentence(found: Found, judged: Outcome) -> str:
    """Say what became of a requirement, in a sentence or two.

    Parameters
    ----------
    found : Found
    judged : Outcome
        The verdict of all evidence together.
    """
    requirement = found.requirement
    text = requirement.text[0].lower() + requirement.text[1:].rstrip(".")
    claim = f"{judged.word.capitalize()}: in {share(requirement, judged)} {text}".replace(
        ": in all inputs", ": for all inputs"
    )
    told = (
        f"{claim}; {_flown(found)}."
        if found.judgement or found.searches
        else (f"{claim}; failing means {requirement.consequence}.")
    )
    return told if judged.verdict == "shown" else f"{told} {judged.why[0].upper()}{judged.why[1:]}."


def _flown(found: Found) -> str:
    """Say how many flights failed, how far the worst went, and what that means."""
    judgement, searches = found.judgement, found.searches
    margins = [float(one.outcome.margins.min()) for one in searches]
    parts, num_found = [], sum(one.first_failed is not None for one in searches)
    if judgement:
        margins.append(judgement.worst_margin)
        failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} did not"
        parts.append(failed if judgement.num_failed else f"all {judgement.num_cases:,} did")
    if num_found:
        parts.append(f"{num_found} of {len(searches)} searches found a flight that did not")
    worst = worst_words(found.requirement, min(margins))
    has_failed = num_found or (judgement and judgement.num_failed)
    consequence = found.requirement.consequence
    return f"{' and '.join(parts)}, {worst}" + (
        f": {consequence}" if has_failed else f"; failing means {consequence}"
    )


def worst_words(requirement: Requirement, margin: float) -> str:
    """Say how far the flight with the least margin went."""
    match requirement.formula:
        case Always(_, Comparison(((name, factor),), constant)) | Eventually(
            _, Comparison(((name, factor),), constant)
        ):
            quantity = QUANTITIES[name]
            if quantity.extremes:
                value = f"{(margin - constant) / factor:.4g} {quantity.unit}"
                return quantity.extremes[factor < 0.0].format(value)
    unit = "" if requirement.unit == "mixed" else f" {requirement.unit}"
    return f"the worst by {-margin:.4g}{unit}" if margin < 0.0 else f"the least margin {margin:.4g}{unit}"
