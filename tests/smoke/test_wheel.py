"""What is installed: the toolkit alone, with what it needs, and the whole project with its configuration."""

import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from email.parser import Parser
from importlib.util import cache_from_source
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from fis_tools.formats.serialize import load
from pipeline.run import maker, manifests
from tests.places import PROJECT
from tests.smoke.command_line import run_module

pytestmark = pytest.mark.slow

PACKAGES = ("pipeline", "telemetry")
EXAMPLES = PROJECT / "docs" / "examples"
MEGABYTE = 1e6
BYTECODE = ".pyc"
#: What the toolkit may weigh with all that it needs, but for drawing and for reading scikit-fuzzy's systems.
MOST_MB = 100.0


def build(folder: Path, into: Path, target: str = "wheel") -> Path:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(into)]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)  # noqa: S603
    (path,) = into.iterdir()
    return path


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build(PROJECT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def small_wheel(tmp_path_factory):
    return build(PROJECT / "fis_tools", tmp_path_factory.mktemp("small_wheel"))


def unpack(wheels: Iterable[Path], site: Path) -> None:
    run_module(
        "pip", "install", "--quiet", "--no-index", "--no-deps", "--no-compile", "--target", site, *wheels,
        folder=site,
    )  # fmt: skip


def content(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def sources(folder: Path) -> set[str]:
    """The files below a folder, as they are called in a wheel."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    return {path.relative_to(PROJECT).as_posix() for path in files}


def test_the_wheel_holds_the_packages_and_the_configuration_inside_pipeline_and_nothing_else(wheel):
    expected = set().union(*(sources(PROJECT / package) for package in PACKAGES))
    expected |= {f"pipeline/{name}" for name in sources(PROJECT / "conf")}
    assert content(wheel) == expected
    assert "telemetry/file/schema/inspection.proto" in content(wheel)
    assert "pipeline/conf/experiment/train.yaml" in content(wheel)


def test_the_toolkits_wheel_holds_its_package_and_the_licence(small_wheel):
    assert content(small_wheel) == sources(PROJECT / "fis_tools") - {"fis_tools/pyproject.toml"}
    assert zipfile.ZipFile(small_wheel).read("fis_tools/LICENSE") == (PROJECT / "LICENSE").read_bytes()


@pytest.mark.parametrize(("folder", "built"), [(".", "wheel"), ("fis_tools", "small_wheel")])
def test_a_source_distribution_builds_the_same_wheel(folder, built, tmp_path, request):
    archive = build(PROJECT / folder, tmp_path / "sources", "sdist")
    shutil.unpack_archive(archive, tmp_path / "unpacked", filter="data")
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    wheels = [request.getfixturevalue(built), build(unpacked, tmp_path / "there")]
    assert wheels[0].name == wheels[1].name
    one, other = ({name: zipfile.ZipFile(path).read(name) for name in content(path)} for path in wheels)
    assert one == other


def test_it_flies_from_any_folder_with_experiments_of_ones_own(wheel, small_wheel, tmp_path):
    installed = tmp_path / "site"
    installed.mkdir()
    unpack((wheel, small_wheel), installed)
    own = tmp_path / "mine" / "experiment"
    own.mkdir(parents=True)
    (own / "drift.yaml").write_text(
        "# @package _global_\n# Drift for ten minutes.\n"
        "defaults:\n  - override /controller: coast\n"
        "name: drift\nstages: [record]\nduration_s: 600.0\n"
        "telemetry: {record_training: false, record_ranked: false, record_start: true}\n"
    )
    # compiled code of another folder would have to be compiled anew, which takes longer than to fly without
    environment = {"PYTHONPATH": str(installed), "NUMBA_DISABLE_JIT": "1"}
    done = run_module(
        "pipeline", "--config-dir", "mine", "+experiment=drift", folder=tmp_path, environment=environment
    )
    folder = tmp_path / done.stdout.strip()
    assert (folder / "episodes" / "start.mcap").is_file()
    versions = manifests.read(folder)["versions"]
    assert versions["product"] == maker.product_version()
    listed = run_module(
        "pipeline", "--help", "--config-dir", "mine", folder=tmp_path, environment=environment
    )
    assert "Drift for ten minutes." in listed.stdout
    where = run_module("pipeline", "--version", folder=tmp_path, environment=environment).stdout
    assert where == f"{maker.DISTRIBUTION} {maker.product_version()}\n"


class Environment:
    """A fresh virtual environment: the toolkit and what it declares to need, as it runs here."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        self.folder = folder
        run_module("venv", "--without-pip", folder, folder=folder.parent)
        (self.site,) = folder.rglob("site-packages")
        unpack((wheel,), self.site)
        (metadata,) = self.site.glob("fis_tools-*.dist-info/METADATA")
        self._declared = Parser().parsestr(metadata.read_text(encoding="utf-8")).get_all("Requires-Dist", [])
        self.distributions: frozenset[str] = frozenset()
        self.distributions = self.install("", self.site)

    def install(self, extra: str, site: Path) -> frozenset[str]:
        """Put into a folder what the toolkit declares to need for an extra of it, but for what it has."""
        had, waiting = set(self.distributions), _applying(self._declared, {extra})
        while waiting:
            wanted = waiting.pop()
            if wanted.name not in had:
                had.add(wanted.name)
                found = importlib.metadata.distribution(wanted.name)
                assert wanted.specifier.contains(found.version)
                self._copy(found, site)
                waiting += _applying(found.requires or [], wanted.extras or {""})
        return frozenset(had)

    def _copy(self, distribution: importlib.metadata.Distribution, site: Path) -> None:
        for file in distribution.files or []:
            source = Path(str(distribution.locate_file(file)))
            if ".." not in file.parts and source.suffix != BYTECODE and source.is_file():
                target = site / file
                self._link(source, target)
                if source.suffix == ".py":  # no command has to compile numba and NumPy anew
                    self._link(Path(cache_from_source(source)), Path(cache_from_source(target)))

    def _link(self, source: Path, target: Path) -> None:
        """Copy a file that nobody writes to, which together are half a gigabyte."""
        if source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(source, target)
            except OSError:  # on another disk
                shutil.copy2(source, target)

    def size_mb(self) -> float:
        files = (path for path in self.site.rglob("*") if path.is_file() and path.suffix != BYTECODE)
        return sum(path.stat().st_size for path in files) / MEGABYTE

    def run(
        self, *words: object, code: int = 0, beside: Path | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run Python, which sees another folder of packages beside its own if there is one."""
        python = next(self.folder.glob("bin/python"), self.folder / "Scripts" / "python.exe")
        inherited = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        done = subprocess.run(  # noqa: S603
            [python, *map(str, words)],
            cwd=self.folder,
            env=inherited | ({"PYTHONPATH": str(beside)} if beside else {}),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return done

    def tools(self, *words: object, code: int = 0) -> subprocess.CompletedProcess[str]:
        return self.run("-m", "fis_tools", *words, code=code)


def _applying(texts: Iterable[str], extras: set[str]) -> list[Requirement]:
    """The requirements that hold on this machine for one of the extras; the empty one stands for none."""
    wanted = map(Requirement, texts)
    return [
        one for one in wanted if one.marker is None or any(one.marker.evaluate({"extra": e}) for e in extras)
    ]


@pytest.fixture(scope="module")
def alone(small_wheel, tmp_path_factory):
    environment = Environment(tmp_path_factory.mktemp("alone") / "environment", small_wheel)
    yield environment
    shutil.rmtree(environment.folder)


def test_the_toolkit_alone_is_small_and_sees_nothing_else(alone, capsys):
    size = alone.size_mb()
    with capsys.disabled():
        print(f"\nfis-tools with {', '.join(sorted(alone.distributions))}: {size:.0f} MB")  # noqa: T201
    assert size < MOST_MB
    look = "import importlib.util as u; print([n for n in %r if u.find_spec(n)])"
    others = ["pipeline", "telemetry", "scipy", "skfuzzy", "matplotlib", "numba", "pyarrow", "hydra", "mcap"]
    assert alone.run("-c", look % others).stdout == "[]\n"


END = "end of a command"
#: to load numba once, and not for each command
ALL_IN_ONE_PROCESS = f"""
import json, sys
from fis_tools.__main__ import main
for words in json.loads(sys.argv[1]):
    assert main(words) == 0, words
    print({END!r}, end="")
"""


@pytest.fixture(scope="module")
def fast(alone, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fast")
    alone.install("fast", folder)
    yield folder
    shutil.rmtree(folder)


def test_the_toolkit_answers_the_same_with_numba_and_without(alone, fast):
    system = EXAMPLES / "dimmer.fll"
    commands = json.dumps([("surface", system), ("bounds", system)], default=str)
    plain, compiled = (alone.run("-c", ALL_IN_ONE_PROCESS, commands, beside=one) for one in (None, fast))
    assert plain.stdout == compiled.stdout


@pytest.mark.parametrize("name", ["tipper.fis", "dimmer.fll", "pendulum.yaml"])
def test_the_toolkit_alone_runs_every_command(alone, fast, tmp_path, name):
    own, simpler = tmp_path / "own.yaml", tmp_path / "simpler.yaml"
    alone.tools("import", EXAMPLES / name, "-o", own)
    inputs = ",".join(f"{v.name}={0.5 * (v.minimum + v.maximum)}" for v in load(own).systems[0].inputs)
    commands = [
        ("show", EXAMPLES / name),
        ("audit", EXAMPLES / name),
        ("bounds", own),
        ("explain", own, "--inputs", inputs),
        ("surface", own),
        *(("export", own, "--format", form) for form in ("markdown", "csv", "html", "latex", "json", "c")),
        ("simplify", own, "--max-change", "5%", "-o", simpler),
        ("diff", own, simpler),
        ("review", own, "-o", tmp_path / "review.html"),
    ]
    told = alone.run("-c", ALL_IN_ONE_PROCESS, json.dumps(commands, default=str), beside=fast).stdout.split(
        END
    )
    assert len(told) == len(commands) + 1
    assert all(told[:11])
    assert (tmp_path / "review.html").stat().st_size > 10_000


def test_the_toolkit_alone_says_what_to_install(alone, tmp_path):
    flight, system = tmp_path / "flight.mcap", EXAMPLES / "tipper.fis"
    flight.touch()
    changed = tmp_path / "changed.fis"
    changed.write_text(system.read_text(encoding="utf-8").replace("[1.5 0]", "[2.5 0]"), encoding="utf-8")
    plot, whole = "matplotlib", "./fis_tools . (in a copy of this project's sources)"
    for package, cure, words in (
        ("matplotlib", plot, ("plot", system)),
        ("matplotlib", plot, ("surface", system, "-o", tmp_path / "surface.png")),
        ("matplotlib", plot, ("diff", system, changed, "-o", tmp_path / "diff.html")),
        ("the package telemetry", whole, ("show", flight)),
    ):
        told = alone.tools(*words, code=2).stderr
        assert told.endswith(
            f" needs {package}, which is not installed; install it: python -m pip install {cure}\n"
        )
        assert told.count("\n") == 1, told
    compile_anything = (
        "import fis_tools\ntry:\n    fis_tools.compile(1)\nexcept fis_tools.MissingExtra as e:\n    print(e)"
    )
    assert alone.run("-c", compile_anything).stdout.endswith(
        "pip install scikit-fuzzy networkx packaging scipy\n"
    )


def test_the_extras_of_the_toolkit_bring_what_they_say(alone, tmp_path):
    extras, figures = tmp_path / "extras", tmp_path / "figures"
    assert alone.install("all", extras) > alone.distributions
    alone.run("-m", "fis_tools", "plot", EXAMPLES / "tipper.fis", "-o", figures, beside=extras)
    assert len(list(figures.glob("*.png"))) >= 3
    code = (
        f"import sys; sys.path.insert(0, {str(EXAMPLES)!r})\nimport fis_tools\n"
        "from tipping import build_tipping\n"
        "print(fis_tools.compile(build_tipping())({'quality': 6.5, 'service': 9.8})['tip'])"
    )
    assert 0.0 < float(alone.run("-c", code, beside=extras).stdout) < 25.0
    shutil.rmtree(extras)
