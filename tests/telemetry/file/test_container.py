"""A file written a chunk at a time against the one that the library `mcap` writes message by message."""

from io import BytesIO

import numpy as np
import pytest
from foxglove_schemas_protobuf.Log_pb2 import Log
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.schema import register_schema

from telemetry.file.container import Container, Messages
from telemetry.file.schema.inspection_pb2 import FisActivation

TOPICS = {"/fis/a": FisActivation, "/log": Log, "/fis/b": FisActivation}
METADATA = {"episode": {"scenario_id": "ω", "seed": "7"}, "empty": {}}
ATTACHMENTS = {"config.yaml": ("application/yaml", b"seed: 7\n"), "none": ("text/plain", b"")}


def drawn(num_times: int) -> list[Messages]:
    """Messages among which not every channel occurs; any bytes may be a message's."""
    generator = np.random.default_rng(5)
    found = []
    for number in range(num_times):
        count = 1 if number == 0 else 50
        channel = generator.integers(1, 4 - number % 2, count)
        time_ns = 10**9 * (100 * number + np.sort(generator.integers(0, 30, count)))
        lengths = generator.integers(0, 300, count)
        begins = np.cumsum(lengths + 5) - lengths
        content = generator.integers(0, 256, begins[-1] + lengths[-1]).astype(np.uint8)
        found.append(Messages(channel, time_ns, begins, lengths, content))
    return found


@pytest.mark.parametrize("num_times", [0, 1, 4])
def test_a_container_has_the_bytes_that_the_library_writes(num_times: int) -> None:
    ours, theirs = BytesIO(), BytesIO()
    container, writer = Container(ours, "tests"), Writer(theirs)
    writer.start(library="tests")
    for name, entries in METADATA.items():
        container.add_metadata(name, entries)
        writer.add_metadata(name, entries)
    for name, (media_type, content) in ATTACHMENTS.items():
        container.add_attachment(name, media_type, content)
        writer.add_attachment(0, 0, name, media_type, content)
    schemas = {kind: register_schema(writer, kind) for kind in (FisActivation,)}
    for topic, kind in TOPICS.items():
        if kind not in schemas:
            schemas[kind] = register_schema(writer, kind)
        assert container.add_channel(topic, kind) == writer.register_channel(topic, "protobuf", schemas[kind])
    sequence = [0, 0, 0, 0]
    for messages in drawn(num_times):
        count = len(messages.lengths)
        starts = [0, 20] if count > 20 else [0]
        # every second message is in another batch
        batches = [messages.part(slice(0, None, 2)), messages.part(slice(1, None, 2))]
        container.add_chunks(batches, np.argsort(np.r_[0:count:2, 1:count:2]), starts)
        for row in range(count):
            if row in starts:
                writer.flush()
            channel, time_ns = int(messages.channel[row]), int(messages.time_ns[row])
            content = messages.content[messages.begins[row] :][: messages.lengths[row]].tobytes()
            writer.add_message(channel, time_ns, content, time_ns, sequence[channel])
            sequence[channel] += 1
        writer.flush()
    container.finish()
    writer.finish()
    assert ours.getvalue() == theirs.getvalue()
    read = list(make_reader(BytesIO(ours.getvalue()), validate_crcs=True).iter_messages())
    assert len(read) == sum(len(messages.lengths) for messages in drawn(num_times))
