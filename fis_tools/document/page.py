"""Pages that need no other file: their templates, what a browser may do with them, the hashes it asks for."""

import base64
import hashlib
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup


def policy(style: str = "") -> Markup:
    """Return the policy of a page without scripts: nothing runs, and nothing is fetched.

    With the source of its style element, no other style is applied.
    """
    allowed = source_hash(style) if style else "unsafe-inline"
    return Markup(
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src '{}'; "
        "img-src data:; base-uri 'none'; form-action 'none'\">"
    ).format(Markup(allowed))  # noqa: S704 - a hash or a word


def template(package: str, folder: str, name: str) -> Template:
    """Return a template in a folder of a package; it escapes all that is put into it."""
    environment = Environment(
        loader=PackageLoader(package, folder),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def read(name: str, package: str = "fis_tools.document") -> str:
    """Return a text file of a package."""
    return (files(package) / name).read_text(encoding="utf-8")


def source_hash(source: str) -> str:
    """Return what a content security policy allows a script or style element of this source by."""
    return "sha256-" + base64.b64encode(hashlib.sha256(source.encode()).digest()).decode("ascii")
