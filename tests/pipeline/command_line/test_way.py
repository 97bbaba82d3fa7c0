"""The way from `main` to a checked configuration, as whoever reads the program walks it."""

import sys
from itertools import groupby
from pathlib import Path

import pipeline
from tests.pipeline.command_line.cases import FLY, use_stages

FOLDER = str(Path(pipeline.__file__).parent)
#: runs the checks of values, which stand with the classes of settings and are not on the way
CHECKER = "/pydantic/"
#: of the function at the end of the way
END = ("schema", "checked")


def events(run) -> list[tuple[str, tuple[str, str]]]:
    """Calls of our functions and returns from them, each a module and a name, until the end of the way."""
    traced = []

    def trace(frame, event, _):
        code = frame.f_code
        if (
            event not in ("call", "return")
            or not code.co_filename.startswith(FOLDER)
            or code.co_name[0] == "<"
        ):
            return
        above = frame
        while above is not None and CHECKER not in above.f_code.co_filename:
            above = above.f_back
        if above is None:
            name = Path(code.co_filename).stem, code.co_name
            traced.append((event, name))
            if (event, name) == ("return", END):
                sys.setprofile(None)

    sys.setprofile(trace)
    try:
        run()
    finally:
        sys.setprofile(None)
    return traced


def way(traced) -> list[str]:
    """The modules that a reader is in, one after another, each function at its first call.

    A function that calls none of another module is read by its name; who comes to the end of one goes back.
    """
    callees, stack = {}, []
    for event, name in traced:
        if event == "call":
            callees.setdefault(stack[-1] if stack else None, set()).add(name[0])
            stack.append(name)
        elif name in stack:
            del stack[len(stack) - 1 - stack[::-1].index(name) :]
    entered, met, modules = [], set(), []
    for event, name in traced:
        if event == "call":
            is_stay = name not in met and not callees.get(name, set()) <= {name[0]}
            met.add(name)
            entered.append((name, is_stay))
            modules += [name[0]] * is_stay
        elif name in [other for other, _ in entered]:
            while entered.pop()[0] != name:
                pass
            modules += [other[0] for other, is_stay in entered if is_stay][-1:]
    return [module for module, _ in groupby(modules)]


def test_a_reader_comes_from_main_to_a_checked_configuration_without_detours(monkeypatch, ran, tmp_path):
    monkeypatch.chdir(tmp_path)
    use_stages(monkeypatch)
    ran(*FLY, "hydra.run.dir=warm")  # what is built at its first use is met once
    stays = way(events(lambda: ran(*FLY, "hydra.run.dir=traced")))
    assert stays[0] == "cli"
    assert stays[-1] == "config"  # which called the schema
    assert "schema" in stays
    assert len(stays) <= 15, stays
    assert len(stays) - len(set(stays)) <= 8, stays
