"""What every test runs under: its share of the processors."""

import os

#: Read by BLAS and OpenMP when they are loaded, and by the commands that tests start.
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")

if "PYTEST_XDIST_WORKER" in os.environ:
    share = max(1, (os.cpu_count() or 1) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"]))
    os.environ.update(dict.fromkeys(THREADS, str(share)))
    # what takes one thread a processor unless it is told otherwise, as flights and inference do
    os.cpu_count = lambda: share
