"""FMUs, validated, loaded and stepped by FMPy, which we did not write; libraries need gcc."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.validation import validate_fmu

from fis_tools.__main__ import main
from fis_tools.engines.compiler import compile
from fis_tools.formats.c import fmu
from fis_tools.formats.serialize import dump_json, load
from fis_tools.model import FuzzyController, FuzzySystem
from tests.fis_tools.engines.weighed_systems import mixed, samples
from tests.places import PROJECT
from tests.programs import program

TIPPER = PROJECT / "docs" / "examples" / "tipper.fis"


def stepped(path: Path, system: FuzzySystem, rows: np.ndarray) -> np.ndarray:
    """Feed rows to an FMU, one a second, and return its answers, (n, num_outputs)."""
    names = [variable.name for variable in system.inputs]
    columns = [("time", float), *((name, float) for name in names)]
    # each row stands from its second to the next: a step, and not a line, leads from one to another
    times = np.repeat(np.arange(len(rows) + 1.0), 2)[1:-1]
    held = [(time, *row) for time, row in zip(times, np.repeat(rows, 2, axis=0), strict=True)]
    found = simulate_fmu(
        str(path),
        stop_time=float(len(rows)),
        output_interval=1.0,
        input=np.array(held, dtype=columns),
        output=[variable.name for variable in system.outputs],
        fmi_type="CoSimulation",
    )
    return np.stack([found[variable.name] for variable in system.outputs], axis=1)[1:]


@pytest.mark.parametrize("name", ["tipper", "mixed"])
def test_a_block_answers_as_the_compiled_system(name: str, tmp_path: Path) -> None:
    program("gcc", "gcc")
    controller = load(TIPPER) if name == "tipper" else FuzzyController("mixed", (mixed(),))
    (system,) = controller.systems
    source, path = tmp_path / "system.json", tmp_path / "system.fmu"
    source.write_text(dump_json(controller), encoding="utf-8")
    assert main(["export", str(source), "--format", "fmu", "-o", str(path)]) == 0
    assert validate_fmu(str(path)) == []
    rows = samples(system, 60)
    np.testing.assert_allclose(stepped(path, system, rows), compile(system)(rows), rtol=0.0, atol=1e-12)


def test_two_archives_of_a_system_hold_the_same_source() -> None:
    (system,) = load(TIPPER).systems
    first, second = (zipfile.ZipFile(io.BytesIO(fmu.pack(system, "00ff").content)) for _ in range(2))
    for name in ("modelDescription.xml", "sources/system.c", "sources/fmi2.c"):
        assert first.read(name) == second.read(name)
        assert first.getinfo(name).date_time == (1980, 1, 1, 0, 0, 0)


def test_without_gcc_the_source_remains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    assert main(["export", str(TIPPER), "--format", "fmu", "-o", str(tmp_path / "out")]) == 0
    assert "the source alone" in capsys.readouterr().out
    names = zipfile.ZipFile(tmp_path / "out" / "tipper.fmu").namelist()
    assert names == ["modelDescription.xml", "sources/system.c", "sources/fmi2.c"]


def test_what_an_archive_cannot_say_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(TIPPER), "--format", "fmu"]) == 2
    assert "an FMU is an archive and cannot be printed; add -o" in capsys.readouterr().err
    champion = PROJECT / "conf" / "controller" / "champion_27.yaml"
    out = tmp_path / "champion.fmu"
    assert main(["export", str(champion), "--format", "fmu", "-o", str(out)]) == 2
    assert "a file of this form holds one system" in capsys.readouterr().err
