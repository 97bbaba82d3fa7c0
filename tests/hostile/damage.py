"""Recordings that say something else than was flown, and damage to files that gets past the first check."""

import copy
import io
import json
import random
from collections.abc import Callable, Mapping
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import CompressionType, Writer

Entries = dict[str, str]


def rewritten(
    content: bytes,
    *,
    entries: Callable[[str, Entries], Entries | None],
    attachment: Callable[[Attachment], bytes] = lambda attached: attached.data,
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
        if (metadata := entries(record.name, kept)) is not None:
            writer.add_metadata(word(record.name), metadata)
    for attached in reader.iter_attachments():
        writer.add_attachment(
            attached.create_time,
            attached.log_time,
            word(attached.name),
            attached.media_type,
            attachment(attached),
        )
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
        attachment=lambda attached: (attachments or {}).get(attached.name, attached.data),
    )


Damage = Callable[[bytes, random.Random], bytes]
#: byte sequences that readers are known to stumble over
PIECES: Final = (
    b"", b"0", b"-1", b"1e400", b"nan", b".inf", b"9" * 400, b"9" * 5000 + b"x", b"[" * 2000, b"{" * 2000,
    b"(" * 500,
    b"\x00", b"\xff\xfe", "\u202e\u00e9".encode(), b"&a [*a]", b"!!python/object/apply:os.system [x]",
    b"../../x",
    b'"', b"'", b"\n", b"\t", b":", b",", b"---\n", b"=cmd()", b"null", b"true", b"1e-320", b"<!DOCTYPE x>",
)  # fmt: skip
#: values that are known to break trees
VALUES: Final[tuple[Any, ...]] = (
    None, True, 0, -1, 1e308, -1e308, 1e-320, 10**30, 10**400, "", "x", "\u202e", [], {}, [[]], {"x": []},
    [0] * 1000,
    "9" * 1000, [1, 2, 3], [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
)  # fmt: skip
COLUMN_TYPES: Final = (
    pa.string(), pa.float64(), pa.int8(), pa.bool_(), pa.binary(), pa.list_(pa.int64()), pa.null(),
    pa.int64(),
)  # fmt: skip


def damaged_bytes(content: bytes, rng: random.Random) -> bytes:
    """Return bytes with cuts, repetitions, swaps, flips and insertions."""
    mutable = bytearray(content)
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(mutable) + 1)
        end = min(len(mutable), at + rng.choice((1, 1, 2, 8, 64, 1024)))
        match rng.randrange(6):
            case 0:
                mutable[at:end] = b""
            case 1:
                mutable[at:end] = rng.choice(PIECES)
            case 2:
                mutable[at:at] = mutable[at:end] * rng.choice((1, 2, 200))
            case 3 if at < len(mutable):
                mutable[at] = rng.randrange(256)
            case 4:
                del mutable[at:]
            case _:
                mutable[at:at] = rng.choice(PIECES)
    return bytes(mutable[: 10 * 1024 * 1024])


def damaged_tree(content: bytes, rng: random.Random) -> bytes:
    """Return plain data with replaced, dropped, added and repeated values."""
    tree = json.loads(content)
    for _ in range(rng.randint(1, 3)):
        node, key = tree, None
        branches: list[tuple[Any, Any]] = []
        while isinstance(node, dict | list) and node:
            keys = list(node) if isinstance(node, dict) else list(range(len(node)))
            key = rng.choice(keys)
            branches.append((node, key))
            node = node[key]
        if not branches:
            break
        branch, key = rng.choice(branches)
        match rng.randrange(5):
            case 0:
                del branch[key]
            case 1 if isinstance(branch, dict):
                branch[rng.choice(("x", "", "\u00e9", "name"))] = copy.deepcopy(rng.choice(VALUES))
            case 2 if isinstance(branch, list):
                branch.extend([branch[key]] * rng.choice((1, 3, 300)))
            case 3 if isinstance(branch[key], int | float):
                branch[key] = (
                    branch[key] * rng.choice((-1, 0, 1e-300, 1e300, 1e12, 1.5)) if branch[key] < 1e300 else 0
                )
            case _:
                branch[key] = copy.deepcopy(rng.choice(VALUES))
    return json.dumps(tree).encode()


def damaged_table(content: bytes, rng: random.Random) -> bytes:
    """Return a table with other column types, gaps and lengths."""
    table = pq.read_table(io.BytesIO(content))
    at = rng.randrange(table.num_columns)
    kind = rng.choice(COLUMN_TYPES)
    value = rng.choice((None, 0, -1, 2**62, 1e300, "x", b"x", [1]))
    values = table.column(at).to_pylist()
    values[rng.randrange(len(values))] = value
    try:
        column = pa.array(values if rng.random() < 0.5 else [value] * len(values), type=kind)
    except (pa.ArrowException, TypeError, ValueError, OverflowError):
        column = pa.nulls(len(values), kind)
    table = table.set_column(at, table.column_names[at], column)
    if rng.random() < 0.3:
        table = table.drop_columns([rng.choice(table.column_names)])
    sink = io.BytesIO()
    pq.write_table(table.slice(0, rng.choice((0, 1, len(values)))), sink)
    return sink.getvalue()


def damaged_recording(content: bytes, rng: random.Random) -> bytes:
    """Return a rewritten recording, with correct checksums but some changed words and messages."""

    def word(text: str) -> str:
        if rng.random() > 0.02:
            return text
        damaged = damaged_bytes(text.encode(), rng).decode("utf-8", "replace")
        return rng.choice((damaged, "[" * 100_000, "", "1e999"))

    return rewritten(
        content,
        entries=lambda _, kept: {k: word(v) for k, v in kept.items()} if rng.random() > 0.05 else None,
        word=word,
        data=lambda data: damaged_bytes(data, rng) if rng.random() < 0.01 else data,
        compression=rng.choice((CompressionType.NONE, CompressionType.ZSTD)),
    )


def damaged_attachment(content: bytes, rng: random.Random) -> bytes:
    """Return a recording whose configuration, controller or words say something else, all checksums right."""
    kept = {attached.name: attached.data for attached in make_reader(io.BytesIO(content)).iter_attachments()}
    name = rng.choice([name for name in kept if name.endswith((".json", ".yaml"))])
    if rng.random() < 0.3:
        key = rng.choice(("noise", "seed", "position_m", "velocity_m_s", "sun_angle_rad", "settings"))
        return forged(content, episode={key: rng.choice(VALUES)})
    how = damaged_tree if name.endswith(".json") and rng.random() < 0.7 else damaged_bytes
    return forged(content, attachments={name: how(kept[name], rng)})


def _either(damage: Damage, probability: float) -> Damage:
    """Return a damage that is so done with a probability, and otherwise to plain bytes."""
    return lambda content, rng: (damage if rng.random() < probability else damaged_bytes)(content, rng)


#: by the kind of a reader
DAMAGES: Final[Mapping[str, Damage]] = {
    "attachments": damaged_attachment,
    "text": damaged_bytes,
    "bytes": damaged_bytes,
    "tree": _either(damaged_tree, 0.7),
    "table": _either(damaged_table, 0.7),
    "recording": _either(damaged_recording, 0.2),
}
