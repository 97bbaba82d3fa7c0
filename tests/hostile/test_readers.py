"""Every reader refuses damaged files in a sentence, soon and in little memory, as `benchmarks fuzz` tries."""

import pytest

from fis_tools.formats import serialize
from tests import night
from tests.hostile.attack import assert_survives_apart, attack
from tests.hostile.giants import GIANTS, SIZE
from tests.hostile.readers import READERS
from tests.hostile.sites import reading_sites, sites_reached
from tests.places import PROJECT


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_a_reader_refuses_what_is_damaged(name, tmp_path):
    reader, tries, folder = READERS[name], night.count(8, 80), tmp_path / "read"
    folder.mkdir()  # beside other tests' folders none is one of a run
    reader.read(reader.samples[0], folder)
    assert attack(reader, tries, 7, folder) == tries


@pytest.mark.slow
def test_every_function_that_opens_a_file_has_a_reader(tmp_path):
    with sites_reached() as reached:
        for name, reader in READERS.items():
            for index, sample in enumerate(reader.samples):
                (folder := tmp_path / f"{name}-{index}").mkdir()
                reader.read(sample, folder)
    assert reading_sites() - reached == set()


def test_every_kind_of_controller_has_a_reader():
    assert {serialize.kind_of(f"x{ending}") for ending in serialize.ENDINGS} <= READERS.keys()


CORPUS = sorted((PROJECT / "tests" / "hostile" / "corpus").iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reader", "name"), night.by_day([giant for giant in GIANTS if giant[0] != "recording"], 4)
)
def test_a_giant_is_read_or_refused_soon_and_in_little_memory(reader, name, tmp_path):
    content = GIANTS[reader, name](READERS[reader].samples[0])
    assert len(content) <= SIZE
    assert_survives_apart(READERS[reader], content, tmp_path)


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.name)
def test_what_once_broke_a_reader_is_refused(path, tmp_path):
    assert_survives_apart(READERS[path.name.partition("-")[0]], path.read_bytes(), tmp_path)
