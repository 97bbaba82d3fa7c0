"""`export` and `import` at the command line: a file a system out, one controller file back."""

from dataclasses import replace

import pytest

from fis_tools.formats.serialize import load
from fis_tools.model import FuzzyController
from tests.fis_tools.formats.exchange.systems import FLAT, NESTED, alone
from tests.fis_tools.sample_controllers import GENERAL, PAPER_LIKE
from tests.places import PROJECT

EXAMPLES = PROJECT / "docs" / "examples"


@pytest.mark.parametrize("form", ["fis", "fll"])
def test_systems_go_into_a_file_each_and_come_back_as_one_controller(tmp_path, saved, run, form):
    source = saved(PAPER_LIKE)
    folder = tmp_path / "new" / "exchange"
    status, printed, notes = run("export", source, "--format", form, "-o", folder)
    files = [folder / f"force_x.{form}", folder / f"force_z.{form}"]
    assert status == 0
    assert printed.split() == [str(path) for path in files]
    assert f"force_x.{form}: attributes are left out: force_axes" in notes
    assert run("import", *files, "-o", tmp_path / "back.yaml") == (0, "", "")
    assert (tmp_path / "back.yaml").read_text(encoding="utf-8") == source.read_text(encoding="utf-8")
    for command in ("show", "audit"):
        assert run(command, files[0])[0] == 0


def test_one_system_goes_to_a_file_or_is_printed(tmp_path, saved, run):
    source = saved(PAPER_LIKE)
    chosen = ("export", source, "--format", "fis", "--system", "force_x")
    _, printed, notes = run(*chosen)
    assert "[System]" in printed
    assert "units are left out" in notes
    assert run(*chosen, "-o", tmp_path / "one.fis")[0] == 0
    assert (tmp_path / "one.fis").read_text(encoding="utf-8") == printed
    for folder in (tmp_path, tmp_path / "new"):
        assert run(*chosen, "-o", folder)[1] == f"{folder / 'force_x.fis'}\n"
        assert (folder / "force_x.fis").read_text(encoding="utf-8") == printed


def test_what_was_assumed_is_printed(tmp_path, run):
    words = ("import", EXAMPLES / "tipper.fis", "--name", "tips", "--points", 201)
    status, _, notes = run(*words, "-o", tmp_path / "tips.json")
    assert status == 0
    assert "assumed: tipper: tip is 15 when no rule fires" in notes
    controller = load(tmp_path / "tips.json")
    assert controller.name == "tips"
    (system,) = controller.systems
    assert {v.num_points for v in (*system.inputs, *system.outputs)} == {201}
    assert run("import", EXAMPLES / "tipper.fis")[1].startswith('{\n  "schema": "fuzzy-controller"')


def test_facts_of_several_files_are_put_together(tmp_path, saved, run, refused):
    one = alone(FLAT)
    other = replace(alone(replace(NESTED, name="other")), provenance=(("made_by", "machine"),))
    paths = [saved(one, "one.yaml"), saved(other, "other.yaml")]
    status, _, notes = run("import", *paths, "-o", tmp_path / "both.json")
    assert status == 0
    assert "left out: the provenance made_by" in notes
    both = load(tmp_path / "both.json")
    assert (both.name, both.attributes, both.provenance) == (one.name, one.attributes, ())
    saved(replace(other, attributes=(("axis", "y"),)), "other.yaml")
    assert "differ in the attribute 'axis'" in refused("import", *paths)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ["export", "PAPER", "--format", "fis"],
            "has several systems, force_x, force_z; add --system, or -o FOLDER",
        ),
        (["export", "PAPER", "--format", "fis", "-o", "x.fis"], "-o FOLDER for a file each"),
        (["export", "GENERAL", "--format", "fis"], "room: rule 1 cannot be said in a .fis file"),
        (["export", "ALIKE", "--format", "fll", "-o", "FOLDER"], "both be written as a_b.fll"),
        (["import", "TIPPER", "TIPPER"], "both have a system 'tipper'"),
        (["import", "TIPPER", "-o", "x.fis"], "ends in none of .json, .yaml, .yml"),
        (["import", "TIPPER", "--points", "1"], "Give a whole number from 2 to 4000000"),
        (["import", "missing.fis"], "cannot be read"),
        (["import", "TIPPER", "--name", " "], "a name is printable text"),
    ],
)
def test_a_mistake_ends_in_one_sentence(tmp_path, saved, refused, words, sentence):
    alike = tuple(replace(FLAT, name=name) for name in ("a b", "A/B"))
    places = {
        "PAPER": saved(PAPER_LIKE),
        "GENERAL": saved(GENERAL, "general.yaml"),
        "ALIKE": saved(FuzzyController("alike", alike), "alike.yaml"),
        "TIPPER": EXAMPLES / "tipper.fis",
        "FOLDER": tmp_path / "out",
        "x.fis": tmp_path / "x.fis",
    }
    told = refused(*(places.get(word, word) for word in words))
    assert sentence.casefold() in told.casefold()
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "x.fis").exists()
