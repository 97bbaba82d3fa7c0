"""Words that the viewer's fonts cannot write."""

import pytest

from telemetry.scene.curves import drawable


@pytest.mark.parametrize(
    ("text", "drawn"),
    [
        ("If distance is near then force_x is +0.5 N", "If distance is near then force_x is +0.5 N"),
        ("Flug über Köln, полёт, πτήση, bay", "Flug über Köln, полёт, πτήση, bay"),
        ("Flug u\u0308ber", "Flug über"),
        ("飛行 🚀", "□□ □"),
        ("a\tb\x00c\nd", "a□b□c\nd"),
    ],
)
def test_signs_without_a_glyph_become_boxes(text: str, drawn: str) -> None:
    assert drawable(text) == drawn
