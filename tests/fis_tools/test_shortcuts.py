"""One line each, from a control system of scikit-fuzzy, a system and a file, without heavy imports."""

import runpy
from pathlib import Path

import pytest

import fis_tools
from fis_tools.errors import ControllerFileError
from fis_tools.formats import serialize
from fis_tools.source import named
from tests.fis_tools.sample_controllers import EXAMPLES, PAPER_LIKE, TIPPER
from tests.programs import run_python


def test_one_line_each_from_a_file(tmp_path: Path) -> None:
    assert "Tipper" in fis_tools.review(TIPPER, tmp_path / "page.html").read_text(encoding="utf-8").title()
    assert fis_tools.surface(TIPPER).output.name == "tip"
    assert fis_tools.audit(TIPPER).findings
    assert fis_tools.compile(TIPPER)({"service": 4.0, "food": 8.0})["tip"] > 0.0
    assert fis_tools.explain(str(TIPPER), {"service": 4.0, "food": 8.0}).outputs[0].variable.name == "tip"
    assert "double infer_" in fis_tools.export_c(TIPPER, tmp_path / "tipper.c").read_text(encoding="utf-8")
    assert all(path.stat().st_size > 1000 for path in fis_tools.plot(TIPPER, tmp_path / "figures"))


def test_a_control_system_goes_the_same_way(tmp_path: Path) -> None:
    build_tipping = runpy.run_path(str(EXAMPLES / "tipping.py"))["build_tipping"]
    assert fis_tools.audit(build_tipping()).findings
    assert fis_tools.review(build_tipping(), tmp_path / "page.html").stat().st_size > 100_000


def test_names_are_shown_and_nothing_heavy_is_imported() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'compiles'"):
        fis_tools.compiles  # noqa: B018
    run_python("-c", "import fis_tools; fis_tools.analysis.bounds.ask")
    code = (
        "import sys, fis_tools; assert set(fis_tools.__all__) <= set(dir(fis_tools)); "
        "heavy = {'numpy', 'numba', 'matplotlib', 'skfuzzy', 'scipy', 'telemetry', 'pyarrow'}; "
        "assert not heavy & set(sys.modules), heavy & set(sys.modules); "
        "import fis_tools.engines.compiler; assert 'skfuzzy' not in sys.modules"
    )
    run_python("-c", code)


def test_an_installed_package_names_folders_of_controllers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "site" / "mine" / "controllers"
    folder.mkdir(parents=True)
    (folder / "gentle.json").write_text(serialize.dump_json(PAPER_LIKE))
    # importing it would end here
    (tmp_path / "site" / "mine" / "__init__.py").write_text("raise SystemExit")
    info = tmp_path / "site" / "mine-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[fis_tools.controllers]\nmine = mine.controllers\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ControllerFileError, match="no controller of that name"):
        named("gentle")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    assert named("gentle") == folder / "gentle.json"
    with pytest.raises(ControllerFileError, match="did you mean 'gentle'"):
        named("gentel")
