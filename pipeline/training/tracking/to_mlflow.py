"""Generations for MLflow; the only module that imports it."""

import logging
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

# do not send usage data
os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")

from mlflow import MlflowClient
from mlflow.entities import Metric, Param
from mlflow.exceptions import MlflowException

from pipeline.settings.experiment import SettingError
from pipeline.training.tracking.told import FAILED, FINISHED, INTERRUPTED, Row, Told

SQLITE = "sqlite:///"
STATUS = {FINISHED: "FINISHED", INTERRUPTED: "KILLED", FAILED: "FAILED"}
#: names of a run's configuration hash, and of a metric that counts the rows written
HASH, COUNTED = "config_hash", "generation"
#: most numbers that MLflow takes at a time
MOST_METRICS = 1000


class Store:
    """A training as an MLflow run: facts as parameters, columns of the logbook as metrics.

    A resumed training continues its run, after the existing rows.

    Parameters
    ----------
    place : str
        A store or a server, in MLflow's notation.
    told : Told
    """

    def __init__(self, place: str, told: Told) -> None:
        logging.getLogger("mlflow").setLevel(logging.WARNING)
        self._place, self._num_told = place, 0
        if place.startswith(SQLITE):
            Path(place.removeprefix(SQLITE)).parent.mkdir(parents=True, exist_ok=True)
        with self._in_words():
            self._client = MlflowClient(tracking_uri=place)
            self._run = self._begun_before(told) or self._begin(told)

    def _begun_before(self, told: Told) -> str | None:
        """Return the run of a resumed training."""
        known = self._client.get_experiment_by_name(told.experiment)
        if known is None or not told.goes_on:
            return None
        for run in self._client.search_runs([known.experiment_id], f"params.{HASH} = '{told.facts[HASH]}'"):
            if run.info.run_name == told.name:
                self._client.update_run(run.info.run_id, status="RUNNING")
                self._num_told = len(self._client.get_metric_history(run.info.run_id, COUNTED))
                return str(run.info.run_id)
        return None

    def _begin(self, told: Told) -> str:
        """Create a run."""
        known = self._client.get_experiment_by_name(told.experiment)
        group = known.experiment_id if known else self._client.create_experiment(told.experiment)
        run = self._client.create_run(group, run_name=told.name).info.run_id
        self._client.log_batch(run, params=[Param(name, value) for name, value in told.facts.items()])
        return str(run)

    @contextmanager
    def _in_words(self) -> Iterator[None]:
        try:
            yield
        except MlflowException as error:
            raise SettingError(
                f"MLflow does not write to tracking.place, {self._place}: {str(error).splitlines()[0]}"
            ) from error

    def tell(self, rows: Sequence[Row]) -> None:
        """Write the new rows."""
        now = round(1000.0 * time.time())
        metrics = [
            Metric(name, value, now, step)
            for step in range(self._num_told, len(rows))
            for name, value in rows[step].items()
        ]
        with self._in_words():
            for first in range(0, len(metrics), MOST_METRICS):
                self._client.log_batch(self._run, metrics[first : first + MOST_METRICS])
        self._num_told = max(self._num_told, len(rows))

    def close(self, ending: str) -> None:
        """Log how it ended."""
        with self._in_words():
            self._client.set_terminated(self._run, STATUS[ending])
