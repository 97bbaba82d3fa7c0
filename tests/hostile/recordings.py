"""Recordings that say something else than was flown."""

import io
import json
from collections.abc import Callable, Mapping

from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

Entries = dict[str, str]


def rewritten(
    content: bytes,
    *,
    entries: Callable[[str, Entries], Entries | None],
    attachment: Callable[[Attachment], bytes] = lambda one: one.data,
    word: Callable[[str], str] = str,
    data: Callable[[bytes], bytes] = bytes,
    compression: CompressionType = CompressionType.ZSTD,
) -> bytes:
    """Return a recording with other metadata, attachments, names and messages, all checksums right.

    `entries` may leave a record out by returning None; `word` changes names, `data` messages.
    """
    reader, sink = make_reader(io.BytesIO(content)), io.BytesIO()
    writer = Writer(sink, compression=compression)
    writer.start()
    for record in reader.iter_metadata():
        kept = {key: text for key, text in record.metadata.items() if key != "crc32"}
        if (told := entries(record.name, kept)) is not None:
            writer.add_metadata(word(record.name), told)
    for one in reader.iter_attachments():
        writer.add_attachment(one.create_time, one.log_time, word(one.name), one.media_type, attachment(one))
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(word(schema.name), schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                word(channel.topic), channel.message_encoding, schemas[schema.id], channel.metadata
            )
        writer.add_message(channels[channel.id], message.log_time, data(message.data), message.publish_time)
    writer.finish()
    return sink.getvalue()


def forged(
    content: bytes,
    *,
    episode: Mapping[str, object] | None = None,
    attachments: Mapping[str, bytes] | None = None,
) -> bytes:
    """Return a recording with other words about its episode, and other attachments."""
    words = {k: v if isinstance(v, str) else json.dumps(v) for k, v in (episode or {}).items()}
    return rewritten(
        content,
        entries=lambda name, kept: kept | words if name == "episode" else kept,
        attachment=lambda one: (attachments or {}).get(one.name, one.data),
    )
