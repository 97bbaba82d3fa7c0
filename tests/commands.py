"""Commands as tests run them, in this process."""

from typing import NamedTuple


class Told(NamedTuple):
    """What a command prints, and what it says besides."""

    out: str
    err: str


def running(main, capsys):
    """Return a function that runs a command, which must end with a code and without a traceback."""

    def run(*words, code=0, slips=False):
        capsys.readouterr()
        assert main([str(word) for word in words]) == code
        streams = Told(*capsys.readouterr())
        assert ("Traceback" in streams.err) == slips
        return streams

    return run
