"""Drawings of evidence: the argument, goal by goal, and how the margins of many flights are spread.

Shapes and arrows of the argument are those of the Goal Structuring Notation, GSN Community Standard version
3, 2021: goals are rectangles, strategies parallelograms, solutions circles, contexts rounded; a filled head
means "solved by", a hollow one "in the context of".
"""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

from markupsafe import Markup

from fis_tools.document.html import element

#: of the drawing, in its own units; text is about half as wide as high
WIDTH, LINE, SIZE = 960, 17, 14
GOAL_X, GOAL_WIDTH, GOAL_HEIGHT = 90, 400, 84
FIRST_SOLUTION_X, SOLUTION_STEP, RADIUS = 570, 116, 46
TOP, FIRST_ROW, ROW = 20, 270, 118
SPINE_X = 45
#: ways of verification, as circles are lettered and columns are headed
METHODS = {
    **{"cases": "cases", "search": "search", "bounds": "bounds", "safety_layer": "safety layer"},
    "tube": "tube",
}


def draw_argument(evidence: Mapping[str, Any]) -> Markup:
    """Draw the argument of evidence as an SVG element whose goals and solutions are links into the page."""
    requirements = evidence["requirements"]
    height = FIRST_ROW + ROW * len(requirements)
    # down from the strategy to the goals
    last = FIRST_ROW + ROW * (len(requirements) - 1) + GOAL_HEIGHT / 2
    parts = [*_top(evidence), _line(f"M{SPINE_X} {TOP + GOAL_HEIGHT + 120}V{last:g}")]
    for row, requirement in enumerate(requirements):
        parts += _row(requirement, FIRST_ROW + ROW * row)
    name = evidence["controller"]["name"]
    return element(
        "svg",
        element("title", f"The argument for {name}, goal by goal", id="argument-name"),
        element("defs", *(_head(name) for name in ("solved-by", "in-context"))),
        *parts,
        class_="argument",
        viewBox=f"0 0 {WIDTH} {height}",
        role="group",
        aria_labelledby="argument-name",
    )


def _head(name: str) -> Markup:
    """Return the head of an arrow."""
    return element(
        "marker",
        element("path", d="M0 0 10 5 0 10z"),
        id=name,
        class_=name,
        viewBox="0 0 10 10",
        refX=9,
        refY=5,
        markerWidth=9,
        markerHeight=9,
        orient="auto-start-reverse",
    )


def _top(evidence: Mapping[str, Any]) -> list[Markup]:
    """Draw the first goal, its contexts and the strategy."""
    conditions = evidence["conditions"]
    near, far = conditions["start_distance_m"]
    speed = conditions.get("start_speed_m_s", 0.0)
    moving = f"at up to {speed:.3g} m/s" if speed else "at rest"
    verdicts = [one["verdict"] for one in evidence["requirements"]]
    overall = next((word for word in ("refuted", "not shown") if word in verdicts), "shown")
    claim = f'{evidence["controller"]["name"]} meets the requirements "{evidence["name"]}"'
    standing = "stands as its goals do, each for its share" if overall == "shown" else overall
    worlds = [
        f"C1: starts {moving}, {near:.3g} to {far:.3g} m away, Sun {conditions['sun']}, "
        f"safety {conditions['safety']}, {conditions['duration_s']:g} s",
        "C2: the operational domain: inputs that flights have met"
        if evidence["domain"]
        else "C2: the controller has no fuzzy inputs, hence no operational domain",
    ]
    parts = [_goal(f"G0: {standing}", claim, overall, SPINE_X - 25, TOP, "#verdicts")]
    for place, (words, link) in enumerate(zip(worlds, ("#provenance", "#domain"), strict=True)):
        y = TOP + 62 * place
        outline = element("rect", class_="context", x=FIRST_SOLUTION_X, y=y, width=350, height=52, rx=26)
        parts.append(_link(link, outline + _text(words, FIRST_SOLUTION_X + 175, y + 26, 42)))
        x = SPINE_X - 25 + GOAL_WIDTH
        parts.append(_arrow(x, TOP + GOAL_HEIGHT / 2, FIRST_SOLUTION_X, y + 26, "in-context"))
    y = TOP + GOAL_HEIGHT + 60
    corners = f"{SPINE_X + 5},{y} {SPINE_X + 375},{y} {SPINE_X + 345},{y + 60} {SPINE_X - 25},{y + 60}"
    words = "S1: argue requirement by requirement, each by the evidence that it asks for"
    parts.append(
        element("polygon", class_="strategy", points=corners) + _text(words, SPINE_X + 175, y + 30, 40)
    )
    parts.append(_arrow(SPINE_X + 175, TOP + GOAL_HEIGHT, SPINE_X + 175, y, "solved-by"))
    return parts


def _row(requirement: Mapping[str, Any], y: float) -> list[Markup]:
    """Draw the goal of a requirement and its solutions."""
    name, middle = requirement["id"], y + GOAL_HEIGHT / 2
    parts = [_arrow(SPINE_X, middle, GOAL_X, middle, "solved-by")]
    words = f"{requirement['text']} Failing means {requirement['consequence']}."
    label = f"{name}: {requirement['verdict']} for {requirement['share'].replace(' or more', '')}"
    parts.append(_goal(label, words, requirement["verdict"], GOAL_X, y, f"#{name}"))
    centre, bus = middle + 20, y + 3
    for place, (method, found) in enumerate(requirement["methods"].items()):
        x = FIRST_SOLUTION_X + SOLUTION_STEP * place
        circle = element("circle", class_=css_of(found), cx=x, cy=f"{centre:g}", r=RADIUS)
        parts.append(_line(f"M{GOAL_X + GOAL_WIDTH} {bus:g}H{x}"))
        parts.append(_arrow(x, bus, x, centre - RADIUS, "solved-by"))
        wrapped = wrap(found["word"].replace(" cases", ""), 12)
        label = _lines([f"Sn-{name}", METHODS[method], *wrapped], x, centre, "small")
        parts.append(_link(f"#{name}-{method}", circle + label))
    return parts


def css_of(found: Mapping[str, Any]) -> str:
    """Return how an outcome is drawn; a failure that a search finds refutes no share of the cases."""
    return {"failure found": "not-shown", "none found": "neutral", "does not apply": "neutral"}.get(
        found["word"], css(found["verdict"])
    )


def _goal(label: str, words: str, verdict: str, x: float, y: float, link: str) -> Markup:
    place = {"x": f"{x:g}", "y": f"{y:g}"}
    outline = element("rect", class_=css(verdict), **place, width=GOAL_WIDTH, height=GOAL_HEIGHT)
    named = element("text", label, class_="name", x=f"{x + 10:g}", y=f"{y + 18:g}")
    return _link(link, outline + named + _text(words, x + GOAL_WIDTH / 2, y + GOAL_HEIGHT / 2 + 9, 50))


def _link(target: str, inside: Markup) -> Markup:
    return element("a", inside, href=target)


def _line(path: str, **more: str) -> Markup:
    return element("path", class_="line", d=path, **more)


def _arrow(x: float, y: float, to_x: float, to_y: float, head: str) -> Markup:
    return _line(f"M{x:g} {y:g}L{to_x:g} {to_y:g}", marker_end=f"url(#{head})")


def _text(words: str, x: float, y: float, width: int) -> Markup:
    """Write words in lines around a point; what does not fit into three ends in an ellipsis."""
    return _lines(wrap(words, width, max_lines=3, placeholder=" …"), x, y)


def _lines(lines: Sequence[str], x: float, y: float, css: str = "") -> Markup:
    first = y - LINE * (len(lines) - 1) / 2 + SIZE * 0.35
    spans = (
        element("tspan", line, x=f"{x:g}", y=f"{first + LINE * place:g}") for place, line in enumerate(lines)
    )
    return element("text", *spans, class_=f"middle {css}".rstrip())


def css(verdict: str) -> str:
    """Return the class of what is drawn in a verdict's colour."""
    return verdict.replace(" ", "-")


BARS_WIDTH, BARS_HEIGHT, BASE, LEFT = 640, 150, 112, 10
#: a number nearer to the zero than this would stand on it
ROOM = 40.0


def draw_margins(histogram: Mapping[str, Any], unit: str, name: str) -> Markup:
    """Draw a histogram of margins as an SVG element.

    Parameters
    ----------
    histogram : mapping
        ``edges``, one more than ``counts``; zero is an edge where margins of both signs are.
    unit : str
        Of the margins.
    name : str
        Of the requirement, for whom does not see the picture.
    """
    edges, counts = histogram["edges"], histogram["counts"]
    span = edges[-1] - edges[0]
    most = max(counts)

    def place(value: float) -> float:
        return float(LEFT + (BARS_WIDTH - 2 * LEFT) * (value - edges[0]) / span)

    bars = []
    for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True):
        if count:
            # the square root, so that few failures among thousands are seen
            height = max(2.0, 100.0 * (count / most) ** 0.5)
            x, width = place(low), max(1.0, place(high) - place(low) - 1.0)
            kind = "refuted" if high <= 0.0 else "shown"
            words = f"{count:,} from {low:.4g} to {high:.4g} {unit}".strip()
            box = {"x": x, "y": BASE - height, "width": width, "height": height}
            bars.append(
                element(
                    "rect",
                    element("title", words),
                    class_=f"bar {kind}",
                    **{side: f"{size:.1f}" for side, size in box.items()},
                )
            )
    marks = [(edges[0], "start"), (edges[-1], "end")]
    if edges[0] < 0.0 < edges[-1]:
        marks.append((0.0, "middle"))
    lines = [element("path", class_="line", d=f"M{LEFT} {BASE}H{BARS_WIDTH - LEFT}")]
    if len(marks) == 3:
        lines.append(element("path", class_="zero", d=f"M{place(0.0):.1f} 4V{BASE}"))
    texts = [
        element("text", number(value), class_=anchor, x=f"{place(value):.1f}", y=BASE + 18)
        for value, anchor in marks
        if anchor == "middle" or len(marks) < 3 or abs(place(value) - place(0.0)) > ROOM
    ]
    caption = f"margin{f' ({unit})' if unit else ''}; heights are square roots of counts"
    return element(
        "svg",
        *(*bars, *lines, *texts),
        element("text", caption, class_="middle", x=BARS_WIDTH / 2, y=BASE + 34),
        class_="margins",
        viewBox=f"0 0 {BARS_WIDTH} {BARS_HEIGHT}",
        role="img",
        aria_label=f"Margins of the cases of {name}: from {edges[0]:.4g} to {edges[-1]:.4g} {unit}",
    )


def number(value: float) -> str:
    """Write a number with a true minus sign."""
    return f"{value:.4g}".replace("-", "−")
