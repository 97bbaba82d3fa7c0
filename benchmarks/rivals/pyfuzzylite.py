"""Time pyfuzzylite on a batch, in a separate environment: SYSTEM.fll INPUTS.npy OUTPUTS.npy.

Prints the least processor time of several repeats in seconds, for its fastest batch size.
"""

import sys
import time
from pathlib import Path

import fuzzylite
import numpy as np

BATCHES = (100, 1000, 10_000)
REPEATS = 5


def main() -> None:
    """Infer all samples, batch after batch."""
    system, inputs_file, outputs_file = sys.argv[1:]
    engine = fuzzylite.FllImporter().from_string(Path(system).read_text(encoding="utf-8"))
    columns = np.load(inputs_file).T.copy()
    outputs = np.empty(columns.shape[1])
    best = float("inf")
    for size in BATCHES:
        for _ in range(REPEATS):
            started = time.process_time()
            for first in range(0, len(outputs), size):
                for variable, column in zip(engine.input_variables, columns, strict=True):
                    variable.value = column[first : first + size]
                engine.process()
                outputs[first : first + size] = engine.output_variables[0].value
            best = min(best, time.process_time() - started)
    np.save(outputs_file, outputs)
    print(best)


if __name__ == "__main__":
    main()
