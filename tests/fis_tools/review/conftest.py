"""Pages that the tests of the review page share."""

import pytest

from tests.browser import opening
from tests.fis_tools.review.cases import CHAMPION, NUM_SAMPLES, hostile_controller, log_flight, written
from tests.fis_tools.sample_controllers import PAPER_LIKE


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("flights")
    return log_flight(folder / "swing.mcap", PAPER_LIKE, NUM_SAMPLES)


@pytest.fixture(scope="session")
def text(flight):
    return written(PAPER_LIKE, [flight])


@pytest.fixture(scope="session")
def hostile_text():
    return written(hostile_controller())


@pytest.fixture(scope="session")
def champion_text(tmp_path_factory):
    folder = tmp_path_factory.mktemp("champion")
    return written(CHAMPION, [log_flight(folder / f"{name}.mcap", CHAMPION, 60) for name in "abc"])


@pytest.fixture(scope="module")
def shown(browser, tmp_path_factory, text):
    """A page that tests use one after the other, leaving it usable."""
    with opening(browser, tmp_path_factory.mktemp("shown")) as open_page:
        yield open_page(text)


@pytest.fixture
def fresh(opened, text):
    """A page that nobody has touched."""
    return opened(text)
