"""The drawing of the way from the Python that flies to checked C."""

from docs.scripts.drawing import Drawing, Pair

WIDTH, HEIGHT = 560, 330
#: the middle of each box and its width, px, and what stands in it
BOXES: tuple[tuple[Pair, int, str], ...] = (
    ((280.0, 290.0), 250, "the Python that flies"),
    ((160.0, 190.0), 220, "controller.c"),
    ((430.0, 190.0), 200, "recorded flights"),
    ((95.0, 70.0), 160, "Frama-C"),
    ((280.0, 70.0), 150, "gcc, clang"),
    ((460.0, 70.0), 170, "QEMU: Cortex-M"),
)
#: what a check asks, below its box
QUESTIONS = {3: "safe for any input?", 4: "the same bits?", 5: "the same bits?\nhow many instructions?"}
#: from which box to which, and how far from their middles, px
ARROWS = (
    (0, 1, -70.0, 0.0),
    (0, 2, 70.0, 0.0),
    (1, 3, -40.0, 0.0),
    (1, 4, 20.0, -30.0),
    (1, 5, 70.0, -50.0),
    (2, 4, -40.0, 30.0),
    (2, 5, 40.0, 20.0),
)
HALF_PX = 20.0


def way_to_c() -> Drawing:
    """Draw what is translated, what is recorded, and which programs compare and prove it."""
    drawing = Drawing(WIDTH, HEIGHT, "From the Python that flies to C", (0.0, float(HEIGHT)), 1.0)
    for first, second, left, right in ARROWS:
        (x, y), (a, b) = BOXES[first][0], BOXES[second][0]
        drawing.arrow((x + left, y - HALF_PX), (a + right, b + HALF_PX + 2.0))
    drawing.word("translated", (170.0, 240.0), "small", -8.0, 4.0, "end")
    drawing.word("flown", (400.0, 246.0), "small", 8.0, 4.0)
    for index, ((x, y), width, words) in enumerate(BOXES):
        corner = drawing.at((x - width / 2, y + HALF_PX))
        drawing.add("rect", x=corner[0], y=corner[1], width=width, height=2 * HALF_PX, rx=6, class_="body")
        drawing.word(words, (x, y), "title", 0.0, 5.0, "middle")
        drawing.word(QUESTIONS.get(index, ""), (x, y - HALF_PX), "", 0.0, 18.0, "middle")
    return drawing
