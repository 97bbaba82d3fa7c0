"""Summarises a recording: the flight, its outcome, and the contents of the file."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from telemetry.file import topics
from telemetry.file.recording import Recording


def aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    """Align the cells of rows of equal length in columns, indented by two spaces."""
    table = [tuple(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  " + "  ".join(map(str.ljust, row, widths)).rstrip() for row in table]


def summarize(recording: Recording) -> dict[str, Any]:
    """Summarise a recording as plain data, fit for JSON.

    Parameters
    ----------
    recording : Recording
        Read completely.

    Returns
    -------
    dict
        ``path``, ``bytes``, ``start_s`` and ``end_s`` (None without messages), ``is_rescued``,
        ``episode`` (the metadata), ``outcome``, ``fuzzy_systems``, ``topics``, ``attachments`` (sizes).
    """
    # a recovered file may have no topics
    times = np.concatenate([np.empty(0), *(topic.time_s for topic in recording.topics.values())])
    return {
        "path": str(recording.path),
        "bytes": recording.path.stat().st_size,
        "start_s": float(times.min()) if times.size else None,
        "end_s": float(times.max()) if times.size else None,
        "is_rescued": topics.RECOVERY_METADATA in recording.metadata,
        "episode": dict(recording.metadata.get(topics.EPISODE_METADATA, {})),
        "outcome": recording.outcome,
        "fuzzy_systems": {name: _system(recording, name) for name in recording.fis_names},
        "topics": {
            name: {"schema": topic.schema, "messages": len(topic)} for name, topic in recording.topics.items()
        },
        "attachments": {name: len(content) for name, content in recording.attachments.items()},
    }


def _system(recording: Recording, name: str) -> dict[str, Any]:
    """Return a fuzzy system's inputs, output and number of rules."""
    words = recording.fis_description(name)
    output = {"output": words.output_name, "output_unit": words.output_unit}
    inputs = dict(zip(words.input_names, words.input_units, strict=True))
    return {"inputs": inputs, **output, "num_rules": len(words.rules)}


def in_words(summary: Mapping[str, Any]) -> list[str]:
    """Render the result of `summarize` in words, one line per entry."""
    has_messages = summary["start_s"] is not None
    span = f"{summary['start_s']:g} to {summary['end_s']:g} s" if has_messages else "no messages"
    lines = [f"{summary['path']}: {summary['bytes'] / 1024:.0f} KiB, {span}"]
    if summary["is_rescued"]:
        lines.append("rescued from a cut or damaged file: the flight may have gone on")
    lines += ["", "episode", *_indented(summary["episode"])]
    lines += ["", "outcome", *_indented(_outcome_in_words(summary["outcome"]))]
    systems = summary["fuzzy_systems"]
    lines += ["", "fuzzy systems", *([] if systems else ["  none"])]
    for name, system in systems.items():
        inputs = ", ".join(
            f"{signal} ({unit})" if unit else signal for signal, unit in system["inputs"].items()
        )
        lines.append(
            f"  {name}: {inputs} -> {system['output']} ({system['output_unit']}), {system['num_rules']} rules"
        )
    counts = {
        name: f"{topic['messages']:5d} x {topic['schema']}" for name, topic in summary["topics"].items()
    }
    lines += ["", "topics", *_indented(counts)]
    sizes = {name: f"{size} bytes" for name, size in summary["attachments"].items()}
    return [*lines, "", "attachments", *_indented(sizes)]


def _outcome_in_words(outcome: Mapping[str, float]) -> dict[str, str]:
    """Describe a flight's outcome: points inspected or how it ended, delta-v, and distance."""
    if not outcome:
        return {}
    counted = outcome["inspectable_count"]
    inspectable = f", of which {counted} can be" if 0 < counted < outcome["num_points"] else ""
    if "end_s" in outcome:
        words = {"end": ending(outcome["inspected_count"] > 0, outcome["end_s"])}
    else:
        words = {
            "points inspected": f"{outcome['inspected_count']} of {outcome['num_points']}" + inspectable,
            "inspection rate": f"{outcome['inspection_rate_percent']:.2f} %",
        }
    return words | {
        "delta-v": f"{outcome['delta_v_m_s']:.4f} m/s",
        "distance": f"{outcome['min_distance_m']:.1f} to {outcome['max_distance_m']:.1f} m",
    }


def ending(is_reached: bool, end_s: float) -> str:
    """Describe how a flight towards a goal ended, and when (s)."""
    return f"the goal is {'' if is_reached else 'not '}reached, {end_s:g} s; the rest does not count"


def _indented(entries: Mapping[str, str]) -> list[str]:
    return aligned(entries.items()) or ["  none"]
