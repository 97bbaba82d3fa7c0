"""What is wrong with a controller file."""


class ControllerFileError(ValueError):
    """A controller file that cannot be read, told in a sentence."""
