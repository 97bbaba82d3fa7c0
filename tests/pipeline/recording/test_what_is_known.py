"""Recordings tell what navigation knew, and from the first on that a controller was edited."""

import numpy as np
import pytest

from fis_tools.formats import serialize
from pipeline.flight.control.controller import from_fuzzy
from pipeline.scenarios import given_start
from tests.fis_tools.sample_controllers import SHIPPED
from tests.pipeline.recording import cases

EDITED = ("decision_period_s: 30.0", "decision_period_s: 40.0")


def test_estimates_are_recorded_with_the_deviations_that_the_filter_expects(tmp_path):
    words = "navigation=fixes", "duration_s=100.0"
    known, log = cases.staged(tmp_path, *words)["/navigation"], cases.flown(*words)
    np.testing.assert_array_equal(known["position_m"], log.estimate[:, :3])
    np.testing.assert_array_equal(known["velocity_m_s"], log.estimate[:, 3:])
    variances = np.array([np.diag(covariance) for covariance in log.estimate_covariance])
    np.testing.assert_allclose(known["position_deviation_m"] ** 2, variances[:, :3], rtol=1e-12)
    np.testing.assert_allclose(known["velocity_deviation_m_s"] ** 2, variances[:, 3:], rtol=1e-12)
    assert np.linalg.norm(known["position_m"] - log.position_m, axis=1).max() > 0.0


@pytest.mark.parametrize("change", [("", ""), EDITED], ids=["as shipped", "edited"])
def test_an_edited_controller_is_told_at_the_start_alone(tmp_path, change):
    text = SHIPPED["champion_27"].read_text(encoding="utf-8").replace(*change)
    experiment = cases.composed("duration_s=50.0").experiment
    flying = from_fuzzy(serialize.loads(text, "yaml"))
    start = given_start(experiment)
    _, recording = cases.recorded(tmp_path / "x.mcap", experiment.mission, flying, start)
    edits = [
        (time, message)
        for time, message in zip(recording["/log"].time_s, recording["/log"]["message"], strict=True)
        if "edited" in message
    ]
    if change == EDITED:
        ((time, message),) = edits
        assert time == 0.0
        assert message.startswith("champion_27 was edited by hand after training")
    else:
        assert edits == []
