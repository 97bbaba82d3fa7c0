"""Scenes are as they were when somebody last looked: entities, components, colours, views and words."""

import re
from types import MappingProxyType

import numpy as np
import pytest
from rerun.chunk import RrdReader

import telemetry
from telemetry.file import topics
from telemetry.file.recording import TopicColumns
from telemetry.scene import campaign, curves, drawing, replay, runs, viewer
from tests import stored
from tests.telemetry import synthetic_flight
from tests.telemetry.synthetic_run import write_evaluation

IDS = re.compile(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}|[0-9a-f]{32}")
#: of each chunk, or of when it was made
LEFT_OUT = re.compile(
    r"RowId|log_time|log_tick|rerun\.controls|^blueprint$|Container.*:contents|ViewContents:query|RecordingInfo|root_container|active_tab"
)


def plain(value):
    """A cell of a chunk as text."""
    if isinstance(value, list) and value and all(isinstance(each, int | float) for each in value):
        return stored.array(value)
    if isinstance(value, list):
        shown = value if len(value) <= 4 else [*value[:2], value[-1]]
        return f"{len(value)}[{'; '.join(map(plain, shown))}]"
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    return stored.rounded(repr(value)) if isinstance(value, str) else str(value)


def flat(values):
    """All that nested lists hold, one after the other."""
    for each in values if isinstance(values, list) else [values]:
        yield from flat(each) if isinstance(each, list) else [each]


def column(values):
    """A column of a chunk as text: all rows of a few, else the first, one in the middle, and the last."""
    numbers = list(flat(values))
    if len(values) > 3 and all(isinstance(each, int | float) for each in numbers):
        return f"{len(values)} rows of {stored.array(np.array(numbers, dtype=float))}"
    rows = values if len(values) <= 3 else [values[0], values[len(values) // 2], values[-1]]
    return f"{len(values)} rows {' | '.join(map(plain, rows))}"


def lines_of(store, reader):
    for chunk in reader.stream(store=store):
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if not LEFT_OUT.search(name)]
        for name in names:
            column_type = batch.schema.field(name).type
            values = batch.column(name)
            values = (
                values.cast("int64") if str(column_type).startswith(("duration", "timestamp")) else values
            )
            yield IDS.sub("ID", f"{chunk.entity_path} {name}: {column(values.to_pylist())}")


def text_of(scene, folder):
    """All that a scene logs, and how it is laid out, in an order of its own."""
    viewer.save(scene, folder / "x.rrd")
    reader = RrdReader(str(folder / "x.rrd"))
    parts = [f"{scene}".partition("layout=")[0]]
    for kind in (reader.recordings(), reader.blueprints()[:1]):
        parts += sorted(line for store in kind for line in lines_of(store, reader))
    return "\n".join(parts) + "\n"


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A flight of twelve periods in a file, and one that is like it but for some numbers."""
    folder = tmp_path_factory.mktemp("small")
    flight = synthetic_flight.fly(12)
    turned = flight.but(
        position_m=1.5 * flight.position_m[:, [1, 2, 0]], delta_v_m_s=0.75 * flight.delta_v_m_s
    )
    return synthetic_flight.record(flight, folder / "first.mcap"), synthetic_flight.record(
        turned, folder / "other.mcap"
    )


def test_the_scene_of_flights_is_as_it_was(small, tmp_path, file_regression):
    file_regression.check(text_of(replay.scene(small), tmp_path), extension=".txt")


def test_the_scene_of_an_evaluation_is_as_it_was(tmp_path, file_regression):
    scene = campaign.scene(write_evaluation(tmp_path / "run"))
    file_regression.check(text_of(scene, tmp_path), extension=".txt")


def test_plots_and_words_of_a_flight_are_as_they_were(small, file_regression):
    first, other = (telemetry.read(path) for path in small)
    times = drawing.sample_times(first)
    image, middles = drawing.activation_map(first, times)
    parts = {
        "names": curves.flight_names([first, other]),
        "mission": curves.mission_plots([first, other], [curves.PLAIN_COLOUR, (9, 8, 7)]),
        "effort": curves.effort_plots(first),
        "fis": curves.fis_plots(first),
        "map": image,
        "middles": middles,
        "cursors": drawing.map_cursors(times),
        "inference": drawing.inference_in_words(first, times),
        "now": drawing.now_in_words(first, times),
        "events": drawing.events_in_words([first, other], ["first", "other"]),
        "summary": drawing.flights_in_words([first], ["first"]),
        "both": drawing.flights_in_words([first, other], ["first", "other"]),
        "sun": drawing.sun_directions(first[topics.MISSION]),
        "cone": drawing.view_cone((0.3, -0.8, 0.5), 0.4, 9),
    }
    file_regression.check(stored.text_of(parts), extension=".txt")


def with_control(recording, **columns):
    """A recording in which the columns of its control are others."""
    control = recording[topics.DEPUTY_CONTROL]
    changed = TopicColumns(**{**vars(control), "columns": MappingProxyType({**control.columns, **columns})})
    kept = MappingProxyType({**recording.topics, topics.DEPUTY_CONTROL: changed})
    return type(recording)(**{**vars(recording), "topics": kept})


def test_what_is_done_and_why_is_in_words_for_each_reason(small, file_regression):
    recording = telemetry.read(small[0])
    control = recording[topics.DEPUTY_CONTROL]
    reasons = [each.name.lower() for each in topics.Reason][: len(control)]
    lines = []
    for force in (0.0, 1.0):
        for reason in [each.name.lower() for each in topics.Reason]:
            names = np.full(control["reason"].shape, reason, dtype=object)
            names[::2, 1] = reasons[0]
            forces = force * control["force_hill_n"] * np.array([1.0, 0.5, -2.0])
            changed = with_control(recording, reason=names, force_hill_n=forces)
            times = drawing.sample_times(recording)
            words = drawing.now_in_words(changed, times), drawing._rest_in_words(changed, times)
            lines += [f"{reason} {force}: {each[k]}" for each in words for k in (0, 1)]
    file_regression.check(stored.rounded("\n".join(lines)) + "\n", extension=".txt")


def test_an_evaluation_in_words_and_plots_is_as_it_was(tmp_path, file_regression):
    evaluation = runs.read_evaluation(write_evaluation(tmp_path / "run"))
    parts = {
        "evaluation": evaluation,
        "outcome": evaluation.outcome,
        "words": campaign.in_words(evaluation),
        "extremes": campaign.extremes(evaluation),
        "distance": campaign.distance_plot(evaluation),
    }
    text = stored.text_of(parts).replace(str(tmp_path), "FOLDER")
    file_regression.check(text, extension=".txt")
