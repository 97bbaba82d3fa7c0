"""Colours whose brightness tells an order, so that it survives grey scale and colour blindness."""

#: cividis (J. R. Nuñez, C. R. Anderton, R. S. Renslow, PLoS ONE 13, 2018) from its lowest to its highest,
#: stated here so that a page is made without matplotlib
BRIGHTNESS = (
    *("#00224e", "#00285b", "#002e6a", "#053371", "#1a386f", "#273e6e", "#32436d", "#3b496c", "#434e6c"),
    *("#4b546c", "#535a6d", "#5a5f6e", "#61656f", "#686a71", "#6f7073", "#767676", "#7d7c78", "#848279"),
    *("#8c8878", "#938e78", "#9b9476", "#a39a74", "#aba072", "#b4a76f", "#bcae6c", "#c4b468", "#cdbb63"),
    *("#d5c25e", "#dec958", "#e7d150", "#f0d846", "#f9e03a", "#fee838"),
)
#: The first of them on which black letters stand out more than white ones.
FIRST_BRIGHT = 15


def level(place: int, count: int) -> int:
    """Return which of the levels of `BRIGHTNESS` the thing at a place among some ordered things has."""
    last = len(BRIGHTNESS) - 1
    return round((0.08 + 0.9 * (place / (count - 1) if count > 1 else 0.7)) * last)


def level_styles() -> str:
    """Return the rules of a style sheet that give each level its ground and a readable ink."""
    inks = ["#ffffff"] * FIRST_BRIGHT + ["#000000"] * (len(BRIGHTNESS) - FIRST_BRIGHT)
    rules = [
        f".level-{place} {{ background: {colour}; color: {ink}; }}"
        for place, (colour, ink) in enumerate(zip(BRIGHTNESS, inks, strict=True))
    ]
    return "\n".join(rules) + "\n"
