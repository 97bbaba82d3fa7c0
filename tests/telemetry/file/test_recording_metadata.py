"""Metadata is strings: what is said comes back, and nonsense is refused."""

import json
import zlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from telemetry import RecordingError
from telemetry.file.metadata import EpisodeDescription, FisDescription, Rehearsal, plain, sealed, unsealed
from tests.telemetry import synthetic_flight

words = st.text(max_size=12).map(plain)
finite = st.floats(allow_nan=False, allow_infinity=False)
triples = st.tuples(finite, finite, finite)


@settings(max_examples=50, deadline=None)
@given(
    st.builds(
        EpisodeDescription,
        scenario_id=st.none() | words,
        seed=st.none() | st.integers(0, 2**63 - 1),
        position_m=st.none() | triples,
        sun_angle_rad=st.none() | finite,
        config_hash=st.none() | words,
        max_distance_m=st.none() | finite,
        boresight=st.none() | triples,
    )
)
def test_an_episode_comes_back(episode: EpisodeDescription) -> None:
    spelled = episode.to_metadata()
    assert all(isinstance(value, str) for value in spelled.values())
    assert EpisodeDescription.from_metadata(spelled) == episode


@settings(max_examples=50, deadline=None)
@given(
    st.builds(
        FisDescription,
        input_names=st.lists(words, max_size=3).map(tuple),
        input_units=st.lists(words, max_size=3).map(tuple),
        output_name=words,
        output_unit=words,
        rules=st.lists(words, max_size=5).map(tuple),
    )
)
def test_a_fuzzy_system_comes_back(description: FisDescription) -> None:
    assert FisDescription.from_metadata(description.to_metadata()) == description


def test_an_episode_has_the_keys_of_the_contract() -> None:
    spelled = synthetic_flight.metadata(synthetic_flight.fly(1))["episode"]
    assert {
        "scenario_id",
        "seed",
        "position_m",
        "velocity_m_s",
        "sun_angle_rad",
        "product_version",
        "config_hash",
    } <= spelled.keys()
    assert (spelled["scenario_id"], spelled["seed"]) == ("circle-0", "7")
    assert spelled["boresight"] == "[-1.0, 0.0, 0.0]"


def test_keys_of_others_are_left_alone() -> None:
    episode = EpisodeDescription.from_metadata({"seed": "3", "mood": "calm"})
    assert episode == EpisodeDescription(seed=3)


def test_nonsense_is_refused() -> None:
    with pytest.raises(RecordingError, match="metadata 'seed' is 'seven'"):
        EpisodeDescription.from_metadata({"seed": "seven"})
    with pytest.raises(RecordingError, match="lacks input_units, output_unit, rules"):
        FisDescription.from_metadata({"input_names": "[]", "output_name": "f"})


@settings(max_examples=50, deadline=None)
@given(words, st.dictionaries(words, words, max_size=4))
def test_sealed_entries_come_back_and_changed_ones_do_not(name: str, entries: dict[str, str]) -> None:
    kept = {key: value for key, value in entries.items() if key != "crc32"}
    stored = sealed(name, kept)
    assert unsealed(name, stored) == kept
    assert stored["crc32"] == str(zlib.crc32(json.dumps([name, sorted(kept.items())]).encode()))
    with pytest.raises(ValueError, match="does not match its checksum"):
        unsealed(name, {**stored, "an entry of more than twelve letters": ""})


def test_a_rehearsal_is_read_as_it_was_written_and_has_a_cost_for_each_name() -> None:
    told = Rehearsal(names=("up", "down"), costs_m_s=(0.25, 1e4), until_s=10.0)
    assert Rehearsal.from_metadata(told.to_metadata()) == told
    for wrong in (
        {"costs_m_s": "[0.25]"},
        {"names": "[]", "costs_m_s": "[]"},
        {"costs_m_s": "1"},
        {"until_s": "x"},
    ):
        with pytest.raises(RecordingError):
            Rehearsal.from_metadata({**told.to_metadata(), **wrong})
