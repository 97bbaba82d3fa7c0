"""What signals and rules are worth: ``python -m benchmarks.structures FOLDER`` trains variants alike.

Each variant of ``controller=ellipse`` is searched by ``+experiment=train_planes`` with the same seed and
starts, and flown from 1,000 starts that no search has seen. Runs go to FOLDER, a table to the terminal.
Variants that are there already are not searched again.
"""

import argparse
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from fis_tools import serialize
from fis_tools.model import FuzzyController, FuzzySystem, Gaussian, Term, Variable, table_rules
from fis_tools.parameters import Bounds, Encoding
from fis_tools.reduction import Planes
from pipeline.controllers import SIGNALS

WORDS = {
    2: ("negative", "positive"),
    3: ("negative", "zero", "positive"),
    5: ("negative_large", "negative_small", "zero", "positive_small", "positive_large"),
}
#: half-widths of the ranges
REACH = {
    "centre_along_track": 120.0,
    "predicted_centre_along_track": 120.0,
    "ring_error_along_track": 60.0,
    "centre_radial": 60.0,
    "ring_error_radial": 80.0,
    "position_cross_track": 80.0,
    "velocity_cross_track": 0.12,
    "target_radial": 1.0,
    "target_setting": 1.0,
    "target_cross_track": 1.0,
}
#: gains of the first search: from where CMA-ES starts
GAIN = {
    "centre_along_track": 0.8,
    "predicted_centre_along_track": 0.8,
    "ring_error_along_track": -0.8,
    "centre_radial": -0.8,
    "ring_error_radial": 0.8,
    "position_cross_track": -0.5,
    "velocity_cross_track": -0.8,
    "target_radial": 0.0,
    "target_setting": 0.3,
    "target_cross_track": 0.4,
}

ACROSS = ("position_cross_track", "velocity_cross_track", "target_cross_track")
ALONG = ("predicted_centre_along_track", "ring_error_along_track", "target_radial")
RADIAL = ("centre_radial", "ring_error_radial", "target_setting")

#: inputs of the three systems, the terms of each of their inputs, and constants that are not tuned but zero
VARIANTS = {
    "whole": ((ALONG, RADIAL, ACROSS), (5, 5, 3), ()),
    "no_prediction": ((("centre_along_track", *ALONG[1:]), RADIAL, ACROSS), (5, 5, 3), ()),
    "no_setting": ((ALONG, (*RADIAL[:2], "predicted_centre_along_track"), ACROSS), (5, 5, 3), ()),
    "no_hold": ((ALONG, RADIAL, ACROSS), (5, 5, 3), ("ring_hold_rad",)),
    "no_coasting": ((ALONG, RADIAL, ACROSS), (5, 5, 3), ("coast_below_points",)),
    "no_dead_band": ((ALONG, RADIAL, ACROSS), (5, 5, 3), ("dead_band_n",)),
    "rules_135": ((ALONG, RADIAL, ACROSS), (5, 3, 3), ()),
    "rules_54": ((ALONG, RADIAL, ACROSS), (3, 3, 2), ()),
    "rules_27": ((ALONG[:2], RADIAL[:2], ACROSS[:2]), (3, 3), ()),
    "rules_12": ((ALONG[:2], RADIAL[:2], ACROSS[:2]), (2, 2), ()),
}


def variable(name: str, num_terms: int) -> Variable:
    """Return an input with even terms, as wide as their spacing asks for."""
    reach = REACH[name]
    means = np.linspace(-reach, reach, num_terms)
    width = 0.8 * reach / (num_terms - 1)
    terms = tuple(
        Term(word, Gaussian(float(mean), width)) for word, mean in zip(WORDS[num_terms], means, strict=True)
    )
    return Variable(name, SIGNALS[name].unit, -reach, reach, terms, description=SIGNALS[name].description)


def template(name: str) -> FuzzyController:
    """Return a variant untrained: tables that lean by `GAIN`."""
    inputs_of, terms, _ = VARIANTS[name]
    base = serialize.load(Path("conf/controller/ellipse.yaml"))
    systems = []
    for system, names in zip(base.systems, inputs_of, strict=True):
        inputs = tuple(variable(*pair) for pair in zip(names, terms, strict=True))
        cells = int(np.prod(terms))
        rules = table_rules(inputs, system.outputs[0], ["zero"] * cells)
        systems.append(FuzzySystem(system.name, inputs, system.outputs, rules))
    encoding = Encoding(tuple(systems), Bounds())
    planes = Planes(encoding)
    genes = planes.reduce(encoding.encode(tuple(systems)))
    at = 0
    for names in inputs_of:
        genes[at : at + len(names)] = [0.5 + 0.25 * GAIN[name] for name in names]
        at += 2 * len(names) + 2
    leaning = encoding.decode(planes.expand(genes[np.newaxis])[0])
    systems = [replace(flat, rules=lean.rules) for flat, lean in zip(systems, leaning, strict=True)]
    return replace(base, name=name, systems=tuple(systems))


def search(name: str, folder: Path, rounds: int) -> None:
    """Train and evaluate a variant in a folder of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    controller = template(name)
    words = [f"optimizer.rounds={rounds}", f"hydra.run.dir={folder / name}"]
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


def main() -> None:
    """Search the variants that are asked for, all of them unless told, and print what they fly like."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.structures", description=__doc__)
    parser.add_argument("folder", type=Path, help="for the runs")
    parser.add_argument("names", nargs="*", default=list(VARIANTS), metavar="NAME", help=", ".join(VARIANTS))
    parser.add_argument("--rounds", type=int, default=16, help="of the search, 10 generations each")
    options = parser.parse_args()
    for name in options.names:
        if not (options.folder / name / "evaluate" / "summary.json").exists():
            search(name, options.folder, options.rounds)
    print("| variant | rules | delta-v (m/s) | inspection rate (%) | cases at 95 % or more | outside |")
    print("|---|---|---|---|---|---|")
    for name in options.names:
        summary = json.loads((options.folder / name / "evaluate" / "summary.json").read_text("utf-8"))
        means = [summary[key] for key in ("delta_v_m_s", "inspection_rate_percent")]
        shares = [100.0 * summary[key]["fraction"] for key in ("success", "violated")]
        rules = sum(len(system.rules) for system in template(name).systems)
        print(
            f"| {name} | {rules} | {means[0]['mean']:.3f} | {means[1]['mean']:.2f} "
            f"| {shares[0]:.1f} % | {shares[1]:.1f} % |"
        )


if __name__ == "__main__":
    main()
