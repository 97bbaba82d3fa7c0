"""The verdict on a requirement in sentences: the claim and its scope, the flights, and missing proofs."""

from pipeline.evaluation.assurance.formula import Always, Eventually, Predicate, kind_of
from pipeline.evaluation.assurance.judgements import Judgement
from pipeline.evaluation.assurance.quantities import EXTREMES, UNITS
from pipeline.evaluation.assurance.requirements import Requirement
from pipeline.evaluation.assurance.verdicts import (
    UNCHECKED,
    Evidence,
    MethodResult,
    percent,
    results_by_method,
    unproved,
)

ORDINALS = (
    *("first", "second", "third", "fourth", "fifth"),
    *("sixth", "seventh", "eighth", "ninth", "tenth"),
)


def sentence(evidence: Evidence, result: MethodResult) -> str:
    """Return the verdict on a requirement in a few sentences.

    Parameters
    ----------
    evidence : Evidence
    result : MethodResult
        The verdict of all evidence together.
    """
    requirement = evidence.requirement
    share, reach = claimed_share(requirement, result), claimed_reach(evidence, result)
    # "refuted for 99 % of cases" would say that it fails in 99 % of them
    word = f"{result.word} as a claim" if result.verdict == "refuted" else result.word
    words = [f'{capitalised(word)} for {share}{reach}: "{capitalised(requirement.text.rstrip("."))}."']
    is_flown = evidence.judgement or evidence.searches
    words.append(f"{_flown(evidence) if is_flown else f'Failing means {requirement.consequence}'}.")
    judgement = evidence.judgement
    if judgement and judgement.premises and not (judgement.idle_premises and result.verdict == "not shown"):
        words.append(_premises(judgement))
    if not result.verdict.startswith("shown"):
        words.append(f"{capitalised(result.why)}.")
    methods = results_by_method(evidence)
    words += [_missing(methods[name]) for name in unproved(evidence) if methods[name].why != result.why]
    return " ".join(words)


def capitalised(words: str) -> str:
    """Return words that begin a sentence."""
    return words[0].upper() + words[1:]


def ordinal(count: int) -> str:
    """Return "first", "second" and so on in words up to ten, then "11th" and so on."""
    if count <= len(ORDINALS):
        return ORDINALS[count - 1]
    is_teen = count % 100 in (11, 12, 13)
    return f"{count}{'th' if is_teen else {1: 'st', 2: 'nd', 3: 'rd'}.get(count % 10, 'th')}"


def claimed_share(requirement: Requirement, result: MethodResult) -> str:
    """Return the share of the cases for which a requirement is claimed or proved, and the confidence."""
    if result.is_proof:
        if result.probability < 1.0:
            given = f", if {' and '.join(result.assumed)}" if result.assumed else ""
            return f"{percent(result.probability)} of cases or more (proved{given})"
        return "all cases (proved)" if requirement.formula else "all inputs (proved)"
    if requirement.formula is None:
        return "all inputs"
    if requirement.probability == 1.0:
        return "all cases"
    return (
        f"{percent(requirement.probability)} of cases or more ({percent(requirement.confidence)} confidence)"
    )


def claimed_reach(evidence: Evidence, result: MethodResult) -> str:
    """Return the scope of a claim in words, to follow its share: times and flights; empty for systems."""
    if evidence.requirement.formula is None or not evidence.duration_s:
        return ""
    times = "at all times" if result.is_continuous else f"at samples {evidence.period_s:g} s apart"
    return f", {times} in flights of {evidence.duration_s:,g} s"


def _premises(judgement: Judgement) -> str:
    """Return how often the premises of implications occurred."""
    occurred = [
        f"{text} occurred in {f'{count:,}' if count else 'none'} of {judgement.num_cases:,} flights"
        for text, count in judgement.premises.items()
    ]
    return f"The premise {' and the premise '.join(occurred)}."


def _missing(result: MethodResult) -> str:
    """Return a sentence on why a requested proof does not prove the requirement."""
    if result.word == UNCHECKED:
        return f"{capitalised(result.why)}."
    return f"The proof asked for does not apply: {result.why}."


def _flown(evidence: Evidence) -> str:
    """Return how many flights failed, how far the worst went, and what a failure means."""
    judgement, searches = evidence.judgement, evidence.searches
    margins = [float(search.outcome.margins.min()) for search in searches]
    parts, num_found = [], sum(search.first_failed is not None for search in searches)
    if judgement:
        margins.append(judgement.worst_margin)
        failed = f"{judgement.num_failed:,} of {judgement.num_cases:,} did not"
        parts.append(failed if judgement.num_failed else f"all {judgement.num_cases:,} did")
    if num_found:
        parts.append(f"{num_found} of {len(searches)} searches found a flight that did not")
    elif searches:
        parts.append(f"all {sum(len(search.scenarios) for search in searches):,} flights of searches did")
    worst = describe_worst(evidence.requirement, min(margins), evidence.worst_unit)
    has_failed = num_found or (judgement and judgement.num_failed)
    consequence = evidence.requirement.consequence
    flown = f"{' and '.join(parts)}, {worst}"
    stake = f": {consequence}" if has_failed else f". Failing means {consequence}"
    return capitalised(flown) + stake


def describe_worst(requirement: Requirement, margin: float, unit: str = "") -> str:
    """Return how far the flight with the least margin went, in words.

    Parameters
    ----------
    requirement : Requirement
    margin : float
    unit : str
        Of the margin, where the requirement's formula compares quantities of several units.
    """
    match requirement.formula:
        case Always(_, Predicate(((name, factor),), constant)) | Eventually(
            _, Predicate(((name, factor),), constant)
        ):
            if kind_of(name) in EXTREMES:
                value = f"{(margin - constant) / factor:.4g} {UNITS[kind_of(name)]}"
                return EXTREMES[kind_of(name)][factor < 0.0].format(value)
    unit = f" {unit if requirement.unit == 'mixed' else requirement.unit}".rstrip()
    return f"the worst by {-margin:.4g}{unit}" if margin < 0.0 else f"the least margin {margin:.4g}{unit}"
