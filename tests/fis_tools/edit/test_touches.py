"""Touches and sessions, without a page."""

import os
from dataclasses import replace

import pytest

from fis_tools.edit import touches
from fis_tools.edit.session import Session
from fis_tools.formats import serialize
from fis_tools.formats.files import ENDINGS
from fis_tools.model import Gaussian, Hedged, Is, Linear, Not, Term, Triangular
from fis_tools.model.membership import SHAPES
from fis_tools.model.validate import InvalidSystem, problems
from tests.fis_tools.sample_controllers import FORCE_X, GENERAL, PAPER_LIKE


@pytest.fixture
def session(tmp_path):
    return Session(tmp_path / "sample.json", PAPER_LIKE)


def test_a_dragged_number_stays_between_its_neighbours() -> None:
    triangle = Triangular(0.0, 1.0, 2.0)
    assert [touches.in_order(triangle, "peak", value) for value in (-1.0, 0.5, 3.0)] == [0.0, 0.5, 2.0]
    assert touches.in_order(triangle, "left", -5.0) == -5.0
    assert touches.in_order(Gaussian(0.0, 2.0), "standard_deviation", -1.0) == 0.002


@pytest.mark.parametrize(
    "name", [name for name, kind in SHAPES.items() if kind.entry.kinds and name not in ("constant", "linear")]
)
def test_a_term_takes_any_shape_about_where_it_was(name) -> None:
    variable = FORCE_X.inputs[0]
    touch = {"what": "reshape", "term": variable.terms[1].name, "shape": name}
    changed = touches.term_touched(FORCE_X, variable, **touch)
    assert problems(changed) == []
    assert changed.inputs[0].terms[1].membership.entry.name == name


def test_a_renamed_term_is_renamed_in_the_rules() -> None:
    variable, output = FORCE_X.inputs[0], FORCE_X.outputs[0]
    for renamed in (variable, output):
        name = renamed.terms[0].name
        changed = touches.term_touched(FORCE_X, renamed, "rename", name, name="other")
        assert problems(changed) == []
        again = changed.variable(renamed.name)
        assert touches.term_touched(changed, again, "rename", "other", name=name) == FORCE_X


def test_the_steps_of_a_gesture_are_undone_together(session) -> None:
    def push(value, gesture):
        system = session.controller.systems[0]
        touch = {"term": system.inputs[0].terms[0].name, "key": "mean", "value": value}
        changed = touches.term_touched(system, system.inputs[0], "drag", **touch)
        session.touch(lambda controller: touches.with_system(controller, changed), gesture)

    def stepped(way):
        session.step(way)
        return session.controller.systems[0].inputs[0].terms[0].membership.mean

    for value in (1.0, 2.0, 3.0):
        push(value, "drag")
    push(4.0, "another")
    assert [stepped(-1), stepped(-1)] == [3.0, 0.0]
    assert session.controller == session.original
    assert (session.can_step(-1), session.can_step(1)) == (False, True)
    assert stepped(1) == 3.0


def test_what_makes_a_problem_is_refused(session) -> None:
    system = session.controller.systems[0]
    term = system.inputs[0].terms[0].name
    unnamed = touches.term_touched(system, system.inputs[0], "rename", term, name=" ")
    with pytest.raises(InvalidSystem, match="a term is called ''"):
        session.touch(lambda controller: touches.with_system(controller, unnamed))
    assert session.controller == session.original


def test_a_term_is_removed_only_where_no_rule_uses_it() -> None:
    system, variable = FORCE_X, FORCE_X.inputs[0]
    wider = touches.term_touched(system, variable, "add")
    assert touches.term_touched(wider, wider.inputs[0], "remove", "term_1") == system
    for count, sentence in (
        (1, "rule 1 uses"),
        (2, "rules 1 and 2 use"),
        (5, "rules 1, 2, 3 and 2 more use"),
    ):
        first = replace(system, rules=system.rules[:count])
        with pytest.raises(ValueError, match=f"{sentence} the term 'very near'"):
            touches.term_touched(first, variable, "remove", "very near")


@pytest.mark.parametrize("side", ["if", "then"])
def test_as_many_turns_as_there_are_terms_lead_back(side) -> None:
    changed = FORCE_X
    for _ in FORCE_X.inputs[0].terms if side == "if" else FORCE_X.outputs[0].terms:
        changed = touches.turned(changed, 0, side, 0, 1)
        assert changed.rules[1:] == FORCE_X.rules[1:]
    assert changed == FORCE_X
    back = touches.turned(touches.turned(FORCE_X, 0, side, 0, 1), 0, side, 0, -1)
    assert back == FORCE_X


def test_a_rule_is_read_in_words_with_all_our_hedges() -> None:
    velocity = next(term.name for term in FORCE_X.inputs[1].terms if " " not in term.name)
    force = FORCE_X.outputs[0].terms[0].name
    words = f"If velocity_body_x is not extremely {velocity} then force_x is {force} with 0.5"
    rule = touches.with_sentence(FORCE_X, 0, words).rules[0]
    assert rule.consequents[0].weight == 0.5
    assert rule.antecedent == Not(Hedged("extremely", Is("velocity_body_x", velocity)))


@pytest.mark.parametrize("ending", [shown_system for shown_system in ENDINGS if shown_system != ".fmu"])
def test_a_copy_is_written_in_every_form_and_replaces_nothing_unasked(session, tmp_path, ending) -> None:
    target = tmp_path / "copies" / f"copy{ending}"
    session.save(target, replaces=False)
    written = sorted(target.parent.iterdir())
    assert written
    with pytest.raises(ValueError, match="there already"):
        session.save(target, replaces=False)
    session.save(target, replaces=True)
    if ending in serialize.ENDINGS:
        read = [system for path in written for system in serialize.load(path).systems]
        assert sorted(system.name for system in read) == sorted(
            shown_system.name for shown_system in session.original.systems
        )


def test_a_disk_that_is_full_leaves_the_controller_that_was_there(session, tmp_path, monkeypatch) -> None:
    target = tmp_path / "own.json"
    session.save(target, replaces=False)
    before = target.read_bytes()
    target.chmod(0o600)

    def break_off(_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as full:
        full.setattr(os, "fsync", break_off)
        with pytest.raises(OSError, match="No space"):
            session.save(target, replaces=True)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]
    session.save(target, replaces=True)
    assert target.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("names", "file", "message"),
    [(("x", "z"), "copy.exe", "ends in none of"), (("../x", ".._X"), "copy.fis", "two systems would both")],
)
def test_what_has_no_form_or_names_alike_is_refused(tmp_path, names, file, message) -> None:
    systems = tuple(replace(FORCE_X, name=name) for name in names)
    session = Session(tmp_path / "sample.json", replace(PAPER_LIKE, systems=systems))
    with pytest.raises(ValueError, match=message):
        session.save(tmp_path / file, replaces=True)
    assert list(tmp_path.iterdir()) == []


def test_copies_of_systems_stay_in_the_folder_that_was_named(tmp_path) -> None:
    systems = tuple(replace(FORCE_X, name=name) for name in ("../x", "z/y"))
    session = Session(tmp_path / "sample.json", replace(PAPER_LIKE, systems=systems))
    session.save(tmp_path / "copy.fis", replaces=False)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy-_x.fis", "copy-z_y.fis"]


def test_changed_attributes_are_told(tmp_path) -> None:
    session = Session(tmp_path / "sample.yaml", GENERAL)
    session.touch(
        lambda controller: replace(controller, attributes=(*controller.attributes, ("zz_gain", "2")))
    )
    assert dict(session.copy().provenance)["edited_from"].endswith(": zz_gain none → 2")
    assert session.copy().name == session.title == f"{GENERAL.name}, edited"
    session.save(tmp_path / "copy.yaml", replaces=False)
    again = Session(tmp_path / "copy.yaml", serialize.load(tmp_path / "copy.yaml"))
    again.touch(lambda controller: replace(controller, attributes=()))
    assert again.copy().name == again.title == session.title  # once is enough
    assert again.proposed().name == f"{GENERAL.name}-edited.yaml"
    session.step(-1)
    assert session.title == session.copy().name == GENERAL.name


def test_a_changed_factor_of_a_takagi_sugeno_term_is_told(tmp_path) -> None:
    system = FORCE_X
    lines = tuple(Term(term.name, Linear((1.0, 2.0), 0.5)) for term in system.outputs[0].terms)
    output = replace(system.outputs[0], terms=lines, aggregation="unbounded_sum")
    system = replace(touches.with_variable(system, output), defuzzifier="weighted_average")
    session = Session(tmp_path / "sample.yaml", replace(PAPER_LIKE, systems=(system,)))
    touch = {"what": "number", "term": output.terms[0].name, "key": "coefficients", "value": "1, 3"}
    session.touch(
        lambda controller: touches.with_system(
            controller, touches.term_touched(controller.systems[0], output, **touch)
        )
    )
    words = dict(session.copy().provenance)["edited_from"]
    assert words.endswith("(1, 2) times the inputs, plus 0.5 → (1, 3) times the inputs, plus 0.5)")
