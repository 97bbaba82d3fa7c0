"""What the tutorial of the editor says of flights is what they come to."""

from dataclasses import replace

import numpy as np
import pytest

from fis_tools.edit.panels import findings
from pipeline.edit import Cases, most_changed
from pipeline.evaluation.statistics import succeeds
from tests.pipeline.edit.cases import CHAMPION, cases_of, pressed
from tests.places import PROJECT

CORNERS = [(place, rule) for place in range(3) for rule in (0, 2, 6, 8)]


@pytest.fixture(scope="module")
def cases() -> Cases:
    return cases_of()


@pytest.fixture(scope="module")
def opened(cases):
    return list(cases.fly(CHAMPION))[-1]


@pytest.fixture(scope="module")
def page() -> str:
    text = (PROJECT / "docs/tutorial/make-it-worse-make-it-better.md").read_text(encoding="utf-8")
    return " ".join(text.split())


def typed(name: str, text: str):
    return replace(CHAMPION, attributes=tuple(sorted((dict(CHAMPION.attributes) | {name: text}).items())))


def succeeded(flown) -> float:
    return 100.0 * float(np.mean(succeeds(flown.episodes)))


def spent(flown) -> float:
    return float(np.mean(flown.episodes["delta_v_m_s"]))


def test_one_press_makes_it_worse(cases, opened, page) -> None:
    worse = pressed(0, 2)
    assert worse.systems[0].rules[1].consequents[0].term == "zero"
    now = list(cases.fly(worse))[-1]
    assert f"{succeeded(now):.1f} % succeed instead of {succeeded(opened):.1f} %, for" in page
    assert f"for {spent(now):.2f} m/s instead of {spent(opened):.2f} m/s; *Inspect* is refuted" in page
    words = {one.title: word for one, word, _ in now.verdicts(cases.requirements)}
    assert words["Inspect"] == "refuted"
    assert f"press {most_changed(opened, now, 1)[0]}." in page
    assert "positive_small (rule 8)" in findings(worse)
    assert "the mirrored rule 8 still pushes up" in page


def test_a_constant_makes_it_better(cases, opened, page) -> None:
    now = list(cases.fly(typed("coast_below_points", "2.5")))[-1]
    compared = {one.metric.name: one for one in cases.compare(opened, now)}
    saved = compared["delta_v_m_s"].difference
    low, high = sorted((-saved.low, -saved.high))
    assert f"Delta-v falls by {-saved.mean:.3f} m/s ({low:.3f} to {high:.3f})" in page
    assert f"the inspection rate by {-compared['inspection_rate_percent'].difference.mean:.2f} %" in page
    assert succeeded(now) == succeeded(opened)


@pytest.mark.slow
def test_what_else_to_try(cases, opened, page) -> None:
    middle = list(cases.fly(pressed(1, 5)))[-1]
    assert f"one press, and {succeeded(middle):.1f} % succeed" in page
    band = list(cases.fly(typed("dead_band_force_x_n", "0.03")))[-1]
    assert f"{succeeded(opened) - succeeded(band):.1f} points of success are lost" in page
    changes = []
    for place, rule in CORNERS:
        system = CHAMPION.systems[place]
        terms, held = system.outputs[0].terms, system.rules[rule].consequents[0].term
        towards = len(terms) // 2 - system.outputs[0].term_index(held)
        now = list(cases.fly(pressed(place, rule + 1, step=int(np.sign(towards)))))[-1]
        changes.append(abs(succeeded(now) - succeeded(opened)))
    assert f"each changes success by {max(changes):.1f} points at most" in page
