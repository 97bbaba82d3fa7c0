from pathlib import Path

import pytest

from telemetry.commands import main
from tests.commands import running
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_flight import SyntheticFlight


@pytest.fixture(scope="session")
def flight() -> SyntheticFlight:
    """A flight of the mission's full length."""
    return synthetic_flight.fly(360)


@pytest.fixture(scope="session")
def flight_file(flight: SyntheticFlight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return synthetic_flight.record(flight, tmp_path_factory.mktemp("full") / "flight.mcap")


@pytest.fixture(scope="session")
def short_flight() -> SyntheticFlight:
    """A flight of three flushes: 60, 60 and 11 samples."""
    return synthetic_flight.fly(130)


@pytest.fixture(scope="session")
def short_file(short_flight: SyntheticFlight, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return synthetic_flight.record(short_flight, tmp_path_factory.mktemp("short") / "short.mcap")


@pytest.fixture
def ran(capsys):
    """Run a command of `telemetry`, see `running`."""
    return running(main, capsys)
