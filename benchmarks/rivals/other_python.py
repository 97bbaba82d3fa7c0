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
    job = json.loads(Path(file).read_text(encoding="utf-8"))
    infer = {"simpful": simpful, "fuzzytool": fuzzytool, "fuzzytool-arrays": fuzzytool_arrays}[engine](job)
    inputs = np.load(inputs_file)
    best = float("inf")
    for _ in range(REPEATS):
        started = time.process_time()
        outputs = infer(inputs)
        best = min(best, time.process_time() - started)
    np.save(outputs_file, outputs)
    print(best)


def simpful(job):
    """Return simpful's inference, one sample at a time, as it supports no arrays."""
    import simpful as sf  # noqa: PLC0415 - one engine per run

    system = sf.FuzzySystem(show_banner=False)
    *inputs, output = job["variables"]
    for variable in job["variables"]:
        terms = [sf.GaussianFuzzySet(mean, width, name) for name, mean, width in variable["terms"]]
        extent = [variable["low"], variable["high"]]
        system.add_linguistic_variable(
            variable["name"], sf.LinguisticVariable(terms, universe_of_discourse=extent)
        )
    said = (
        " AND ".join(f"({name} IS {term})" for name, term in conditions) for conditions, _ in job["rules"]
    )
    concluded = (term for _, term in job["rules"])
    system.add_rules([f"IF {a} THEN ({output['name']} IS {b})" for a, b in zip(said, concluded, strict=True)])

    def infer(rows):
        answers = []
        for row in rows:
            for variable, value in zip(inputs, row, strict=True):
                system.set_variable(variable["name"], value)
            inferred = system.Mamdani_inference([output["name"]], subdivisions=job["points"])
            answers.append(inferred[output["name"]])
        return np.array(answers)

    return infer


def _fuzzytool(job):
    import fuzzytool as ft  # noqa: PLC0415 - as above
    from fuzzytool import membership  # noqa: PLC0415

    variables = {}
    for variable in job["variables"]:
        made = ft.Variable(variable["name"], (variable["low"], variable["high"]), resolution=job["points"])
        for name, mean, width in variable["terms"]:
            made[name] = membership.gauss(mean, width)
        variables[variable["name"]] = made
    system = ft.Mamdani()
    output = variables[job["variables"][-1]["name"]]
    for conditions, term in job["rules"]:
        system.rule(reduce(and_, (variables[name][word] for name, word in conditions)), output[term])
    return system, [variable["name"] for variable in job["variables"][:-1]]


def fuzzytool(job):
    """Return fuzzytool's inference, one call per sample."""
    system, names = _fuzzytool(job)
    return lambda rows: np.array([system(**dict(zip(names, row, strict=True))) for row in rows])


def fuzzytool_arrays(job):
    """Return fuzzytool's inference of whole arrays."""
    system, names = _fuzzytool(job)
    return lambda rows: system.predict(**dict(zip(names, rows.T, strict=True)))


if __name__ == "__main__":
    main()
