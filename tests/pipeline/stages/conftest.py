"""Pages of evidence are tested in a browser."""

from tests.browser import axe, browser, opened

__all__ = ["axe", "browser", "opened"]
