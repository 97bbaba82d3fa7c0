"""Recordings of another writer."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType, Writer


def plain_file(path: Path, compression: CompressionType, chunk_size: int, messages: Iterable[Any]) -> Path:
    """Write (schema, channel, message), as the mcap library reads them."""
    with path.open("wb") as output:
        writer = Writer(output, compression=compression, chunk_size=chunk_size)
        writer.start()
        channels: dict[str, int] = {}
        for schema, channel, message in messages:
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, "protobuf", schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.log_time)
        writer.add_metadata("episode", {"scenario_id": "plain"})
        writer.finish()
    return path
