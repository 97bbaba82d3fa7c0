"""Writes rtamt_table.json beside this file: formulas, short traces, and what rtamt makes of them.

rtamt 0.4 needs an older antlr than Hydra, so this runs in an environment of its own::

    python -m venv ENVIRONMENT
    ENVIRONMENT/bin/python -m pip install rtamt==0.4.10
    ENVIRONMENT/bin/python tests/pipeline/evaluation/assurance/rtamt_table.py
"""

import json
import random
from importlib.metadata import version
from pathlib import Path

import rtamt

#: ours, and rtamt's where it writes the same another way; it reads x - y + z as x - (y + z)
FORMULAS = {
    "a >= 1": None,
    "a < 0.5": None,
    "2 * a - b + 1 > b - 3": "((2*a - b) + 1) > (b - 3)",
    "not (a > 1)": None,
    "a > 0 and b > 0": "(a > 0) and (b > 0)",
    "a > 0 or b > 0": "(a > 0) or (b > 0)",
    "a > 0 -> b > 0": "(a > 0) implies (b > 0)",
    "always a > 0": "always (a > 0)",
    "always[0:3] a > 0": "always[0:3] (a > 0)",
    "always[2:5] a > 0": "always[2:5] (a > 0)",
    "eventually a > 0": "eventually (a > 0)",
    "eventually[1:7] a > 0": "eventually[1:7] (a > 0)",
    "eventually[4:4] b < 1": "eventually[4:4] (b < 1)",
    "eventually[5:30] b < 1": "eventually[5:30] (b < 1)",
    "a > -1 until b > 1": "(a > -1) until (b > 1)",
    "a > -1 until[0:3] b > 1": "(a > -1) until[0:3] (b > 1)",
    "a > -1 until[2:6] b > 1": "(a > -1) until[2:6] (b > 1)",
    "always (a > 1 -> eventually[0:4] b > 0)": "always ((a > 1) implies (eventually[0:4] (b > 0)))",
    "always[0:6] (a > 1 -> eventually[1:3] (b > 0 and a < 1))": (
        "always[0:6] ((a > 1) implies (eventually[1:3] ((b > 0) and (a < 1))))"
    ),
    "eventually[0:5] always[0:3] a > -1": "eventually[0:5] (always[0:3] (a > -1))",
    "not (always[0:4] a > 0 until[1:5] b > 1)": "not ((always[0:4] (a > 0)) until[1:5] (b > 1))",
}
LENGTHS = (2, 3, 9, 20)


def robustness_by_rtamt(formula: str, trace: dict[str, list[float]]) -> list[float]:
    """Return rtamt's robustness at every sample of a trace, one second apart."""
    specification = rtamt.StlDiscreteTimeSpecification()
    for name in (*trace, "out"):
        specification.declare_var(name, "float")
    specification.spec = f"out = {formula}"
    specification.set_sampling_period(1, "s", 0.1)
    specification.parse()
    times = list(range(len(trace["a"])))
    return [value for _, value in specification.evaluate({"time": times, **trace})]


def main() -> None:
    """Write the table."""
    draw = random.Random(1)  # noqa: S311 - traces, no secrets
    traces = [{name: [round(draw.gauss(0, 2), 2) for _ in range(n)] for name in "ab"} for n in LENGTHS]
    cases = [
        {"formula": ours, "trace": index, "robustness": robustness_by_rtamt(theirs or ours, trace)}
        for ours, theirs in FORMULAS.items()
        for index, trace in enumerate(traces)
    ]
    table = {"rtamt": version("rtamt"), "traces": traces}
    text = json.dumps(table | {"cases": cases})
    Path(__file__).with_suffix(".json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
