"""Commands as tests run them, in this process."""

from typing import NamedTuple

from tests.state import unchanged


class CommandOutput(NamedTuple):
    """What a command prints on standard output and on standard error."""

    out: str
    err: str


def running(main, capsys):
    """Return a function that runs a command, without a traceback and changed state; a code None is any."""

    def run(*words, code=0, slips=False):
        capsys.readouterr()
        with unchanged():
            assert main([str(word) for word in words]) == code or code is None
        streams = CommandOutput(*capsys.readouterr())
        assert ("Traceback" in streams.err) == slips
        return streams

    return run
