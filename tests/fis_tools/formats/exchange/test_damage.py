"""No damage to a foreign file gives anything but a sentence."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fis_tools.formats.exchange import fis, fll, fml
from fis_tools.formats.serialize import ControllerFileError, Kind, dump_json, loads
from fis_tools.model.validate import controller_problems
from tests.fis_tools.formats.exchange.systems import alone, nested_system
from tests.places import PROJECT

EXAMPLES = PROJECT / "docs" / "examples"
TEXTS: dict[Kind, list[str]] = {
    "fis": [(EXAMPLES / "tipper.fis").read_text(encoding="utf-8"), fis.write(alone(nested_system())).text],
    "fll": [(EXAMPLES / "dimmer.fll").read_text(encoding="utf-8"), fll.write(alone(nested_system())).text],
    "fml": [(EXAMPLES / "pendulum.fml").read_text(encoding="utf-8"), fml.write(alone(nested_system())).text],
}
DAMAGE = st.sampled_from([*"[](){}<>,:;='\"#%/&!-.0159e \n\t\\", "nan", "-1", "1e999", "not ", "--"])


def read_or_refused(text: str, kind: Kind) -> str:
    """Read what may be damaged; tell what came of it: read, refused, or what is wrong about either."""
    try:
        controller = loads(text, kind)
    except ControllerFileError as error:
        is_told = all(0 < len(line.strip()) < 1000 for line in str(error).split("\n"))
        return "refused" if is_told else f"refused without a sentence a fault: {error}"
    if problems := controller_problems(controller):
        return f"read with faults: {problems}"
    return "read" if loads(dump_json(controller), "json") == controller else "read, and another when written"


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(list(TEXTS)), st.booleans(), st.data())
def test_damage_anywhere(kind: Kind, is_ours: bool, data: st.DataObject) -> None:
    text = TEXTS[kind][is_ours]
    for _ in range(data.draw(st.integers(1, 4))):
        start, length = data.draw(st.integers(0, len(text))), data.draw(st.integers(0, 8))
        text = text[:start] + data.draw(DAMAGE | st.text(max_size=3)) + text[start + length :]
    assert read_or_refused(text, kind) in ("read", "refused")


@settings(max_examples=80, deadline=None)
@given(st.sampled_from(list(TEXTS)), st.data())
def test_lines_mixed_up(kind: Kind, data: st.DataObject) -> None:
    lines = TEXTS[kind][0].splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        first = data.draw(st.integers(0, len(lines) - 1))
        second = data.draw(st.integers(0, len(lines) - 1))
        if data.draw(st.booleans()):
            lines[first], lines[second] = lines[second], lines[first]
        else:
            lines.insert(first, lines[second])
    assert read_or_refused("\n".join(lines), kind) in ("read", "refused")


@pytest.mark.parametrize("kind", list(TEXTS))
def test_our_files_cut_anywhere_are_refused(kind: Kind) -> None:
    text = TEXTS[kind][1].rstrip()
    for length in [*range(0, len(text), 61), len(text) - 1]:
        assert read_or_refused(text[:length], kind) == "refused"
    assert read_or_refused(text, kind) == "read"


@pytest.mark.parametrize("kind", list(TEXTS))
def test_foreign_files_cut_anywhere(kind: Kind) -> None:
    text = TEXTS[kind][0]
    for length in range(0, len(text), 37):
        assert read_or_refused(text[:length], kind) in ("read", "refused")
