"""Elements of HTML and SVG, with all that is put into them escaped."""

from typing import Any

from markupsafe import Markup, escape


def element(tag: str, *inside: object, **attributes: Any) -> Markup:
    """Return an element of HTML or SVG; what is put into it is escaped, unless it is Markup.

    Underscores in the names of attributes stand for hyphens; one at the end, as of ``class_``, for nothing.
    Attributes that are None or empty are left out.
    """
    return void(tag, **attributes) + Markup().join(map(escape, inside)) + Markup(f"</{tag}>")  # noqa: S704


def void(tag: str, **attributes: Any) -> Markup:
    """Return an element that has nothing inside, such as ``img``; attributes are as of `element`."""
    words = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for name, value in attributes.items()
        if value not in (None, "")
    )
    return Markup(f"<{tag}{words}>")  # noqa: S704 - escaped above
