"""Packages that only some uses need, and what to say where one is missing."""


class MissingExtra(ImportError):  # noqa: N818
    """Something needs a package that this installation lacks.

    Parameters
    ----------
    use : str
        What needs the package.
    package : str
        What is missing.
    cure : str
        The words after ``python -m pip install`` that install it.
    """

    def __init__(self, use: str, package: str, cure: str) -> None:
        super().__init__(
            f"{use} needs {package}, which is not installed; install it: python -m pip install {cure}"
        )
