"""Pages of reports are as they were when somebody last looked at them: sections, words, tables, pictures."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.evaluation import paired_runs
from pipeline.report import fit, page, pictures, played, sweep, sweep_page
from pipeline.report.comparisons import BesideOptimum, Without
from pipeline.report.contents import FlightSet
from plain_files.document import Document
from plain_files.document import html as documents
from tests import stored
from tests.pipeline.evaluation.test_paired_runs import evaluation
from tests.pipeline.report.made_up import (
    FRONT,
    compared,
    contents,
    episodes,
    fleet_flight,
    flight_set,
    illustrated,
    logbook,
)
from tests.pipeline.report.test_sweep_page import SHIFTS, write_runs
from tests.pipeline.report.test_tables_in_words import share, tally

__all__ = ["illustrated"]
NOTHING = {
    **dict.fromkeys(
        ("training", "evaluation", "without_safety", "logbook", "front", "training_round", "compared")
    ),
    **{
        "pairs": (),
        "shown": (),
        "comparison": (),
        "beside": BesideOptimum(None, {}, "no plans"),
        "recordings": {},
    },
    **{"command": "", "config_text": "", "manifest": {}},
}
DOCKING = ("+experiment=evaluate", "problem=docking", "controller=champion_docking", "duration_s=600")


def of_everything(folder):
    return contents(folder)


def of_fleets(folder):
    words = (
        "+experiment=evaluate_fleet",
        "controller=champion_27",
        "fleet.deputies=3",
        "sun=random",
        "duration_s=600",
    )
    k = np.arange(23)
    together = {
        "nearest_pair_m": 9.5 + k,
        "greatest_delta_v_m_s": 0.4 + 0.01 * k,
        "enough_s": 900.0 + 10.0 * k,
    }
    deputies = episodes(69) | {"deputy": np.tile([1, 2, 3], 23)}
    made = flight_set(23, columns=together)
    numbers = {
        name: {"mean": 5.5, "standard_deviation": 0.75, "low": 5.25, "high": 5.875} for name in together
    }
    spans = {
        name: each | {"minimum": 1.5 + i, "maximum": 9.25 + i}
        for i, (name, each) in enumerate(numbers.items())
    }
    flown = FlightSet(made.episodes, None, made.summary | spans, deputies)
    made = contents(folder, *words, **NOTHING | {"evaluation": flown})
    shown = fleet_flight(made.experiment, 3)
    unsafe = Without(5, 4, 2, shown.fleet[0].flight, shown.fleet[1].flight)
    return contents(
        folder, *words, **NOTHING | {"evaluation": flown, "shown": [shown], "without_safety": unsafe}
    )


def of_comparison(folder):
    words = ("+experiment=baselines", "compare.controllers=[lqr,champion_27]", "sun=random")
    return contents(folder, *words, **NOTHING | {"comparison": compared()})


def of_worlds(folder):
    words = ("+experiment=robustness", "compare.controllers=[lqr,champion_27]")
    rows = [row for world in ("paper", "range 150 m") for row in compared(world, planned=False)]
    return contents(folder, *words, **NOTHING | {"comparison": rows})


def of_docking(folder):
    k = np.arange(21)
    ends = {"end_s": 800.0 + 31.0 * k, "end_speed_m_s": 0.02 + 0.001 * k, "excess_m_s": -0.1 + 0.004 * k}
    numbers = {
        name: {
            "mean": values.mean(),
            "standard_deviation": values.std(),
            "minimum": values[0],
            "maximum": values[-1],
        }
        for name, values in ends.items()
    }
    flown = flight_set(
        21, columns=ends, **numbers, held={"fraction": 0.8125, "low": 0.75, "high": 0.90625, "count": 17}
    )
    for name in ("delta_v_m_s", "mean_distance_m"):
        flown.summary[name] |= {"minimum": 0.125, "maximum": 9.875}
    front = {name: np.array(column) for name, column in FRONT.items()}
    others = {
        "evaluation": flown,
        "front": front,
        "recordings": {"episodes/start.mcap": 5},
        "comparison": compared(),
    }
    made = contents(folder, *DOCKING, **NOTHING | others)
    return contents(
        folder,
        *DOCKING,
        **NOTHING
        | others
        | {"manifest": contents(folder).manifest, "command": "python -m pipeline x", "spread": made.spread},
    )


def of_nothing(folder):
    return contents(folder, "+experiment=fly", "controller=coast", **NOTHING)


def of_papers(folder):
    words = ("+experiment=reproduce",)
    return contents(
        folder,
        *words,
        **NOTHING | {"evaluation": flight_set(40), "training": flight_set(25), "logbook": logbook((0, 0))},
    )


KINDS = {
    each.__name__: each
    for each in (of_everything, of_fleets, of_comparison, of_worlds, of_docking, of_nothing, of_papers)
}


def in_short(figure):
    """Of a figure, which is stored in full elsewhere, what data and words it has."""
    kept = re.compile(r" dots per inch|^(title|legend|text|LineCollection)")
    lines = [
        re.sub(r" (zorder|dashes|ha)\S*=.*", "", line)
        for line in map(str.strip, figure.splitlines())
        if kept.search(line)
    ]
    return "\n".join(lines)


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_and_its_pictures_are_as_they_were(kind, tmp_path, illustrated, monkeypatch, file_regression):
    made = KINDS[kind](tmp_path)
    monkeypatch.setattr(
        pictures,
        "fly_tracked",
        lambda *_: (
            None,
            np.zeros((2, 60, 6), np.float32)
            + np.geomspace(90.0, 2.0, 60)[:, None] * (1, 0.5, 0.25, -1e-3, 2e-3, 0),
        ),
    )
    drawn = {each.name: each for each in pictures.draw(made)}
    text = stored.page(page.write(made, drawn, None))
    text += "".join(f"{name}: {each.caption}\n" for name, each in drawn.items()) + "\n".join(
        map(in_short, illustrated.values())
    )
    file_regression.check(text, extension=".txt", basename=kind)


def test_the_page_of_a_sweep_is_as_it_was(tmp_path, illustrated, file_regression):
    shares = {(name, seed): 0.15 * seed * (name == "second") for name in SHIFTS for seed in (1, 2, 3)}
    write_runs(tmp_path, ["scenario", "evaluate"], ahead=shares)
    results = sweep.gather_results(tmp_path)
    text = stored.page(sweep_page.write(results)) + "\n".join(illustrated.values())
    columns = stored.text_of(
        {"settings": sweep.columns_of(results), "effects": sweep.effect_columns(results)}
    )
    file_regression.check((text + columns).replace(str(tmp_path), "RUNS"), extension=".txt")


def test_runs_side_by_side_are_as_they_were(file_regression):
    first, second = evaluation(1), evaluation(1, shift=0.07)
    second["success"] = second["success"] ^ (np.arange(40) % 5 == 0)
    second["violated"] = second["violated"] ^ (np.arange(40) % 7 == 0)
    compared_runs = paired_runs.compare(first, second, 90.0)
    blocks = sweep_page.compared_table(("x", "y"), compared_runs, [12.5, 37.5], 90.0, "C")
    file_regression.check(stored.page(documents.page(Document(blocks), "")), extension=".txt")


def test_the_page_of_a_fit_is_as_it_was(file_regression):
    kinds = ("shipped", "fitted", "layered", "planned", "tuned", "last")
    result = {kind: tally(0.5 + 0.07 * k, 40 + k, 12.5 * k) for k, kind in enumerate(kinds)}
    for k, kind in enumerate(kinds):
        result[kind] |= {
            name: share(0.1 * k + 0.03 * j) | {"count": k + j}
            for j, name in enumerate(("success", "exits", "misses"))
        }
        result[kind] |= {"delta_v": 0.5 + 0.125 * k, "words": f"variant {k}"}
    limits = [
        {"sentence": "The range is short.", "kept": True},
        {"sentence": "The light goes.", "kept": False},
    ]
    result |= {"safety": "filter", "words": "champion_27 by 1.5", "goal_percent": 95.0, "limits": limits}
    result |= {
        "layer_refused": "it has no brakes",
        "rivals": [tally(0.25, ahead=25.0), tally(0.75, 12, 50.0)],
    }
    file_regression.check(stored.page(fit.render_fit("law", result)), extension=".txt")


@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_a_page_plays_of_cases_is_as_it_was(count, monkeypatch, file_regression):
    """Without the flights, of which there are none."""
    monkeypatch.setattr(played, "panel", lambda made: made)
    monkeypatch.setattr(played, "_played", lambda run, rows, telling: [(run.name, list(rows), list(telling))])
    mission = contents(Path("nowhere"), "+experiment=fly", **NOTHING | {"spread": None}).experiment.mission
    runs = []
    for number in range(count):
        columns = episodes(14)
        columns["delta_v_m_s"] = np.roll(columns["delta_v_m_s"], 3 * number) + 0.1 * number
        runs.append(
            SimpleNamespace(
                name=f"run {number}", episodes=columns, experiment=SimpleNamespace(mission=mission)
            )
        )
    made = played.player_of_runs(runs, [range(1, 13)] * count, "mine")
    file_regression.check(stored.text_of(made), extension=".txt")
