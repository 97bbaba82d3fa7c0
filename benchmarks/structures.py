"""The value of signals and rules: ``python -m benchmarks structures FOLDER`` trains variants alike.

Each variant of ``controller=ellipse`` is searched by ``+experiment=train_planes`` with the same seed and
starts, and flown from 1,000 starts not used in the search. Runs go to FOLDER, a table to the terminal.
Existing variants are not searched again.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fis_tools.formats import serialize
from fis_tools.genes.parameters import Bounds, SystemEncoding
from fis_tools.genes.planes import GREATEST_GAIN, Planes
from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Variable, table_rules
from pipeline.evaluation.monte_carlo import SUCCESS
from pipeline.flight.state.signals import SIGNALS

WORDS = {
    2: ("negative", "positive"),
    3: ("negative", "zero", "positive"),
    5: ("negative_large", "negative_small", "zero", "positive_small", "positive_large"),
}
#: half-widths of the ranges of inputs that ``ellipse`` does not have, and the gains that CMA-ES starts from
OTHERS = {
    "centre_along_track": (250.0, 1.2),
    "target_radial": (1.0, 1.3),
    "target_along_track": (1.0, 1.4),
    "target_cross_track": (1.0, 0.8),
    "target_setting": (1.0, 1.4),
}

ALONG = ("predicted_centre_along_track", "ring_error_along_track", "urgent_radial")
RADIAL = ("centre_radial", "ring_error_radial", "urgent_along_track")
ACROSS = ("position_cross_track", "velocity_cross_track", "urgent_cross_track")
WHOLE = (ALONG, RADIAL, ACROSS)

#: inputs of the three systems, the terms of each of their inputs, and constants set to zero instead of tuned
VARIANTS = {
    "whole": (WHOLE, (5, 5, 3), ()),
    "centroid": (
        (
            (*ALONG[:2], "target_radial"),
            (*RADIAL[:2], "target_along_track"),
            (*ACROSS[:2], "target_cross_track"),
        ),
        (5, 5, 3),
        ("urgency_time_s", "skirt_distance_m"),
    ),
    "setting": (
        ((*ALONG[:2], "target_radial"), (*RADIAL[:2], "target_setting"), (*ACROSS[:2], "target_cross_track")),
        (5, 5, 3),
        ("urgency_time_s", "skirt_distance_m"),
    ),
    "no_skirt": (WHOLE, (5, 5, 3), ("skirt_distance_m",)),
    "no_prediction": ((("centre_along_track", *ALONG[1:]), RADIAL, ACROSS), (5, 5, 3), ()),
    "no_coasting": (WHOLE, (5, 5, 3), ("coast_below_points",)),
    "no_dead_band": (WHOLE, (5, 5, 3), ("dead_band_n",)),
    "rules_135": (WHOLE, (5, 3, 3), ()),
    "rules_54": (WHOLE, (3, 3, 2), ()),
    "rules_27": ((ALONG[::2], RADIAL[1:], ACROSS[1:]), (3, 3), ()),
}


def variable(name: str, num_terms: int, known: Mapping[str, Variable]) -> Variable:
    """Return an input with evenly spaced terms of matching width."""
    reach = OTHERS[name][0] if name in OTHERS else known[name].maximum  # ranges are symmetric
    low, high = -reach, reach
    means = np.linspace(low, high, num_terms)
    width = 0.4 * (high - low) / (num_terms - 1)
    terms = tuple(
        Term(word, Gaussian(float(mean), width)) for word, mean in zip(WORDS[num_terms], means, strict=True)
    )
    return Variable(name, SIGNALS[name].unit, low, high, terms, description=SIGNALS[name].description)


def leaning(systems: Sequence[FuzzySystem], gains: Mapping[str, float]) -> tuple[FuzzySystem, ...]:
    """Return systems with planar rule tables, with a gain for each input."""
    planes = Planes(SystemEncoding(tuple(systems), Bounds()))
    genes = planes.reduce(planes.encoding.encode(tuple(systems)))
    names = planes.gene_names()
    for system in systems:
        for name in (variable.name for variable in system.inputs):
            genes[names.index(f"{system.name}.{name}.gain")] = 0.5 + 0.5 * gains[name] / GREATEST_GAIN
    leaned = planes.encoding.decode(planes.expand(genes[np.newaxis])[0])
    return tuple(replace(flat, rules=lean.rules) for flat, lean in zip(systems, leaned, strict=True))


def gains_of(systems: Sequence[FuzzySystem]) -> dict[str, float]:
    """Return the gain of each input in the rule tables of some systems."""
    planes = Planes(SystemEncoding(tuple(systems), Bounds()))
    genes = planes.reduce(planes.encoding.encode(tuple(systems)))
    pairs = zip(planes.gene_names(), genes, strict=True)
    return {
        name.split(".")[1]: GREATEST_GAIN * (2.0 * gene - 1.0)
        for name, gene in pairs
        if name.endswith(".gain")
    }


def template(name: str) -> FuzzyController:
    """Return an untrained variant: the shipped ``ellipse`` with other inputs or terms."""
    inputs_of, terms, _ = VARIANTS[name]
    base = serialize.load(Path("conf/controller/ellipse.yaml"))
    known = {variable.name: variable for system in base.systems for variable in system.inputs}
    gains = gains_of(base.systems) | {other: gain for other, (_, gain) in OTHERS.items()}
    systems = []
    for system, names in zip(base.systems, inputs_of, strict=True):
        inputs = tuple(variable(*pair, known) for pair in zip(names, terms, strict=True))
        rules = table_rules(inputs, system.outputs[0], ["zero"] * int(np.prod(terms)))
        systems.append(FuzzySystem(system.name, inputs, system.outputs, rules))
    return replace(base, name=name, systems=leaning(systems, gains))


def search(name: str, folder: Path, rounds: int, sun: str) -> None:
    """Train and evaluate a variant in its own folder."""
    folder.mkdir(parents=True, exist_ok=True)
    controller = template(name)
    words = [f"optimizer.rounds={rounds}", f"sun={sun}", f"hydra.run.dir={folder / name}"]
    for constant in VARIANTS[name][2]:
        words.append(f"optimizer.encoding.{constant}=null")
        zeroed = {
            key: "0.0" for key, _ in controller.attributes if key.startswith(constant.removesuffix("_n"))
        }
        attributes = dict(controller.attributes) | zeroed
        controller = replace(controller, attributes=tuple(sorted(attributes.items())))
    path = folder / f"{name}.json"
    path.write_text(serialize.dump_json(controller) + "\n", encoding="utf-8")
    command = [sys.executable, "-m", "pipeline", "+experiment=train_planes", f"controller={path}", *words]
    subprocess.run(command, check=True)  # noqa: S603 - our own command line


def main(arguments: Sequence[str]) -> None:
    """Search the requested variants, all by default, and print their results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks structures", description=__doc__)
    parser.add_argument("folder", type=Path, help="for the runs")
    parser.add_argument("names", nargs="*", default=list(VARIANTS), metavar="NAME", help=", ".join(VARIANTS))
    parser.add_argument("--rounds", type=int, default=16, help="of the search, 10 generations each")
    parser.add_argument("--sun", choices=("fixed", "random"), default="random", help="random unless told")
    options = parser.parse_args(arguments)
    for name in options.names:
        if not (options.folder / name / "evaluate" / "summary.json").exists():
            search(name, options.folder, options.rounds, options.sun)
    print("| variant | rules | delta-v (m/s) | inspection rate (%) | success rate | outside |")
    print("|---|---|---|---|---|---|")
    for name in options.names:
        summary = json.loads((options.folder / name / "evaluate" / "summary.json").read_text("utf-8"))
        means = [summary[key] for key in ("delta_v_m_s", "inspection_rate_percent")]
        shares = [100.0 * summary[key]["fraction"] for key in (SUCCESS, "violated")]
        rules = sum(len(system.rules) for system in template(name).systems)
        print(
            f"| {name} | {rules} | {means[0]['mean']:.3f} | {means[1]['mean']:.2f} "
            f"| {shares[0]:.1f} % | {shares[1]:.1f} % |"
        )


if __name__ == "__main__":
    main(sys.argv[1:])
