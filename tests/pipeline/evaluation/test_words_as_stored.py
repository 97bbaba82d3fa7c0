"""What evaluations say of results made by hand is as it was when somebody last looked."""

from dataclasses import replace

import numpy as np

from pipeline.command_line.config import compose_experiment
from pipeline.evaluation import comparison, paired, selection
from pipeline.evaluation.assurance import campaign, sentences, verdicts
from pipeline.evaluation.assurance.formula import parse
from pipeline.evaluation.assurance.quantities import UNITS
from pipeline.evaluation.statistics import Fraction
from pipeline.training.evolution.state import Generation
from tests import stored
from tests.pipeline.evaluation.assurance.cases import REQUIREMENT, cases
from tests.pipeline.evaluation.assurance.test_verdicts import BOUNDED, LAYER, OFF, gathered, searched
from tests.pipeline.report.made_up import compared

FORMULAS = (
    "always distance <= 150",
    "eventually inspected >= 90",
    "always speed <= 0.25",
    "always distance >= 12.5",
)


def evidences():
    yield gathered(judgement=cases(3), searches=(searched(1.0, -0.5),), proof=OFF)
    yield gathered(judgement=cases(40, 700), searches=(searched(1.0, 2.5), searched(-3.0, 4.0)), proof=LAYER)
    yield gathered(judgement=cases(0, 50), proof=BOUNDED, duration_s=3600.0, period_s=10.0)
    yield gathered(judgement=cases(2, 450), proof=replace(LAYER, num_safe=998))
    yield gathered("bounds", bounds=("no", "undecided"))
    yield gathered("bounds", bounds=("no", "no"))
    yield gathered("search", searches=(searched(1.5, 2.0), searched(0.75)))
    yield gathered("cases", "splitting", judgement=cases(1, 900))
    for k, text in enumerate(FORMULAS, 1):
        claim = {"formula_text": text, "formula": parse(text, UNITS), "probability": 1.0 if k == 2 else 0.99}
        requirement = replace(REQUIREMENT, **claim)
        yield replace(
            gathered(judgement=cases(2 * k), searches=(searched(0.25 * k, -0.5 * k),), proof=OFF),
            requirement=requirement,
        )


def test_verdicts_are_told_as_they_were(file_regression):
    parts = []
    for evidence in evidences():
        result = verdicts.verdict(evidence)
        parts.append(
            {
                "result": result,
                "sentence": sentences.sentence(evidence, result),
                "methods": verdicts.results_by_method(evidence),
                "unproved": verdicts.unproved(evidence),
            }
        )
    ordinals = " ".join(map(sentences.ordinal, (1, 9, 10, 11, 12, 13, 21, 22, 23, 24, 101, 111, 112)))
    joint = [verdicts.joint_confidence(each) for each in ((0.9,), (0.9, 0.95), (0.9, 0.99, 0.995))]
    file_regression.check(
        stored.text_of({"of": parts, "ordinals": ordinals, "joint": joint}), extension=".txt"
    )


def test_searches_are_told_as_they_were(file_regression):
    random = searched(0.5, -0.25, 2.0, 1.5, -1.0, 3.0).outcome
    parts = []
    for searches in ([searched(1.0, -0.5, 0.25), searched(-2.0, 1.0)], [searched(4.0, 0.5)]):
        made = campaign.search_efficiency(searches, random)
        parts.append(
            {
                "made": made,
                "ratio": made.ratio,
                "sentence": made.sentence,
                "worst": [each.worst for each in searches],
                "first": [each.first_failed for each in searches],
            }
        )
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_comparisons_are_told_as_they_were(file_regression):
    rows = [*compared(), *compared()[:1]]
    worlds = [row for world in ("paper", "leo", "geo") for row in compared(world, planned=False)]
    weaker = replace(
        worlds[-1],
        summary=worlds[-1].summary
        | {"success_and_within_limits": {"count": 1, "fraction": 0.04, "low": 0.01, "high": 0.2}},
    )
    worlds[-1] = weaker
    parts = {
        "table": comparison.format_comparison(rows),
        "cells": [comparison.as_cells(row) for row in rows[:2]],
    }
    parts |= {
        "header": comparison.HEADER,
        "worlds": comparison.format_worlds(worlds),
        "verdicts": comparison.verdicts(worlds),
    }
    parts |= {"broken": [" ".join(names) for names in sorted(comparison.broken_worlds(worlds))]}
    words = ("+experiment=baselines", "compare.controllers=[lqr]")
    for more in ((), ("problem=docking",), ("safety=filter", "compare.safety=[filter]")):
        parts[f"columns {more}"] = comparison.describe_columns(compose_experiment([*words, *more]).experiment)
    paper = comparison.published_row(comparison.PAPER_TEST)
    parts["paper"] = comparison.as_cells(paper)
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_differences_are_told_as_they_were(file_regression):
    gained = [0.5 * k - 2.0 + 0.125 * (k % 3) for k in range(11)]
    parts = {}
    for name, made in (
        ("numbers", paired.of_numbers(np.array(gained), 90.0)),
        ("runs", paired.of_runs(np.array(gained[:4]), 95.0)),
        ("shares", paired.of_shares(9, 4, 57, 95.0)),
        ("none", paired.of_shares(0, 0, 12, 95.0)),
    ):
        parts[name] = {"made": made, "words": made.in_words(3), "has": made.has_interval}
    parts |= {
        "mcnemar": paired.mcnemar(11, 3),
        "tango": paired.tango_interval(7, 2, 31, 90.0),
        "shown": paired.shown([0.001, 0.03, 0.2, 0.011], 95.0),
    }
    file_regression.check(stored.text_of(parts), extension=".txt")


def test_what_was_selected_is_told_as_it_was(file_regression):
    share = Fraction(17, 0.85, 0.7125, 0.9375)
    parts = []
    for name in (selection.GIVEN, selection.START, selection.CHAMPION, selection.MEMBER):
        generation = made_generation() if name == selection.CHAMPION else None
        candidate = selection.Candidate(name, None, generation, 3.25 if generation else None)
        judgement = selection.SelectionJudgement(candidate, 20, 1.75, 0.625, share, 0.5, 97.25, 2.5)
        parts.append(
            {
                "sentence": judgement.sentence,
                "where": judgement.where,
                "summary": judgement.summary(),
                "row": judgement.row(),
                "trained": candidate.is_trained,
            }
        )
    file_regression.check(stored.text_of(parts), extension=".txt")


def made_generation():
    values = dict.fromkeys(Generation.__dataclass_fields__)
    return Generation(**values | {"round": 1, "generation": 4})
