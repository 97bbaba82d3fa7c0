"""One line each, from a control system of scikit-fuzzy, a system and a file, without heavy imports."""

import runpy
from pathlib import Path

import pytest

import fis_tools
from tests.fis_tools.sample_controllers import EXAMPLES, TIPPER
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
