"""Recordings that say something else than was flown."""

import io
import json
from collections.abc import Mapping

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer


def forged(
    content: bytes,
    *,
    episode: Mapping[str, object] | None = None,
    attachments: Mapping[str, bytes] | None = None,
) -> bytes:
    """Return a recording with other words about its episode, and other attachments, all checksums right."""
    reader, sink = make_reader(io.BytesIO(content)), io.BytesIO()
    writer = Writer(sink, compression=CompressionType.ZSTD)
    writer.start()
    for record in reader.iter_metadata():
        entries = {key: text for key, text in record.metadata.items() if key != "crc32"}
        if record.name == "episode":
            entries |= {key: value if isinstance(value, str) else json.dumps(value)
                        for key, value in (episode or {}).items()}  # fmt: skip
        writer.add_metadata(record.name, entries)
    for one in reader.iter_attachments():
        data = (attachments or {}).get(one.name, one.data)
        writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, data)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
            )
        writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
    writer.finish()
    return sink.getvalue()
