"""The review page: one HTML file of one controller and its flights, for the person who signs it off."""

import sys
from pathlib import Path
from types import ModuleType


class _Review(ModuleType):
    """A package that can be called, so that ``fis_tools.review(system, "page.html")`` is one line."""

    def __call__(self, thing: object, path: Path | str = "review.html") -> Path:
        """Write the review page of a system, a controller, a file or a scikit-fuzzy control system."""
        from fis_tools.review import page  # noqa: PLC0415 - takes long to import
        from fis_tools.source import as_controller  # noqa: PLC0415

        Path(path).write_text(page.write(as_controller(thing)), encoding="utf-8")
        return Path(path)


sys.modules[__name__].__class__ = _Review
