"""Time simpful or fuzzytool in a separate environment: ENGINE SYSTEM.json INPUTS.npy OUTPUTS.npy.

ENGINE is ``simpful``, ``fuzzytool`` (one call per sample) or ``fuzzytool-arrays``. Prints the least processor
time of several repeats, in seconds.
"""

import json
import sys
import time
from functools import reduce
from operator import and_
from pathlib import Path

import numpy as np

REPEATS = 3


def main() -> None:
    """Infer all samples."""
    engine, file, inputs_file, outputs_file = sys.argv[1:]
    told = json.loads(Path(file).read_text(encoding="utf-8"))
    infer = {"simpful": simpful, "fuzzytool": fuzzytool, "fuzzytool-arrays": fuzzytool_arrays}[engine](told)
    inputs = np.load(inputs_file)
    best = float("inf")
    for _ in range(REPEATS):
        started = time.process_time()
        outputs = infer(inputs)
        best = min(best, time.process_time() - started)
    np.save(outputs_file, outputs)
    print(best)


def simpful(told):
    """Return simpful's inference, one sample at a time, as it supports no arrays."""
    import simpful as sf  # noqa: PLC0415 - one engine per run

    system = sf.FuzzySystem(show_banner=False)
    *inputs, output = told["variables"]
    for one in told["variables"]:
        terms = [sf.GaussianFuzzySet(mean, width, name) for name, mean, width in one["terms"]]
        extent = [one["low"], one["high"]]
        system.add_linguistic_variable(
            one["name"], sf.LinguisticVariable(terms, universe_of_discourse=extent)
        )
    said = (" AND ".join(f"({name} IS {term})" for name, term in asked) for asked, _ in told["rules"])
    concluded = (term for _, term in told["rules"])
    system.add_rules([f"IF {a} THEN ({output['name']} IS {b})" for a, b in zip(said, concluded, strict=True)])

    def infer(rows):
        answers = []
        for row in rows:
            for one, value in zip(inputs, row, strict=True):
                system.set_variable(one["name"], value)
            found = system.Mamdani_inference([output["name"]], subdivisions=told["points"])
            answers.append(found[output["name"]])
        return np.array(answers)

    return infer


def _fuzzytool(told):
    import fuzzytool as ft  # noqa: PLC0415 - as above
    from fuzzytool import membership  # noqa: PLC0415

    variables = {}
    for one in told["variables"]:
        made = ft.Variable(one["name"], (one["low"], one["high"]), resolution=told["points"])
        for name, mean, width in one["terms"]:
            made[name] = membership.gauss(mean, width)
        variables[one["name"]] = made
    system = ft.Mamdani()
    output = variables[told["variables"][-1]["name"]]
    for asked, term in told["rules"]:
        system.rule(reduce(and_, (variables[name][word] for name, word in asked)), output[term])
    return system, [one["name"] for one in told["variables"][:-1]]


def fuzzytool(told):
    """Return fuzzytool's inference, one call per sample."""
    system, names = _fuzzytool(told)
    return lambda rows: np.array([system(**dict(zip(names, row, strict=True))) for row in rows])


def fuzzytool_arrays(told):
    """Return fuzzytool's inference of whole arrays."""
    system, names = _fuzzytool(told)
    return lambda rows: system.predict(**dict(zip(names, rows.T, strict=True)))


if __name__ == "__main__":
    main()
