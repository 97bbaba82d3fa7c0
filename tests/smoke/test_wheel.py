"""What is installed: the toolkit alone, with what it needs, and the whole project with its configuration."""

import importlib.metadata
import os
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Sequence
from email.parser import Parser
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import build_backend
from fis_tools.formats.serialize import load
from pipeline.run import maker, manifests
from tests.places import PROJECT
from tests.programs import run_python

pytestmark = pytest.mark.slow

EXAMPLES = PROJECT / "docs" / "examples"
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


def content(wheel: Path) -> set[str]:
    return {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}


def sources(folder: Path) -> set[str]:
    """The files below a folder, as they are called in a wheel."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    return {path.relative_to(PROJECT).as_posix() for path in files}


def test_the_wheel_holds_the_packages_and_the_configuration_inside_pipeline_and_nothing_else(wheel):
    packages = sources(PROJECT / "pipeline") | sources(PROJECT / "telemetry")
    assert content(wheel) == packages | {f"pipeline/{name}" for name in sources(PROJECT / "conf")}
    assert "telemetry/file/schema/inspection.proto" in content(wheel)
    assert "pipeline/conf/experiment/train.yaml" in content(wheel)


def test_the_toolkits_wheel_holds_its_packages_and_the_licence(small_wheel):
    packages = sources(PROJECT / "fis_tools") | sources(PROJECT / "plain_files")
    assert content(small_wheel) == packages - {"fis_tools/pyproject.toml"}
    assert zipfile.ZipFile(small_wheel).read("fis_tools/LICENSE") == (PROJECT / "LICENSE").read_bytes()


@pytest.mark.parametrize(("folder", "built"), [(".", "wheel"), ("fis_tools", "small_wheel")])
def test_a_source_distribution_builds_the_same_wheel(folder, built, tmp_path, request):
    archive = build(PROJECT / folder, tmp_path / "sources", "sdist")
    run_python("-m", "tarfile", "--extract", archive, tmp_path / "unpacked")
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    wheels = [request.getfixturevalue(built), build(unpacked, tmp_path / "there")]
    assert wheels[0].name == wheels[1].name
    entry, other = ({name: zipfile.ZipFile(path).read(name) for name in content(path)} for path in wheels)
    assert entry == other


def test_it_flies_from_any_folder_with_experiments_of_ones_own(wheel, small_wheel, tmp_path):
    site, options = tmp_path / "site", ("--no-index", "--no-deps", "--no-compile")
    run_python("-m", "pip", "install", *options, "--target", site, wheel, small_wheel, folder=tmp_path)
    experiments = tmp_path / "mine" / "experiment"
    experiments.mkdir(parents=True)
    (experiments / "drift.yaml").write_text("""# @package _global_
# Drift for ten minutes.
defaults: [override /controller: coast]
name: drift
stages: [record]
duration_s: 600.0
telemetry: {record_training: false, record_ranked: false, record_start: true}
""")
    # compiled code of another folder would have to be compiled anew, which takes longer than to fly without
    installed = {"folder": tmp_path, "path": site, "NUMBA_DISABLE_JIT": "1"}
    pipeline = ("-m", "pipeline", "--config-dir", "mine")
    folder = tmp_path / run_python(*pipeline, "+experiment=drift", **installed).stdout.strip()
    assert (folder / "episodes" / "start.mcap").is_file()
    assert manifests.read(folder)["versions"]["product"] == maker.product_version()
    assert "champion_27" in run_python("-m", "fis_tools", "show", "champion_27", **installed).stdout
    named = run_python(*pipeline, "+experiment=drift", "controller=champion_27", "--cfg", "job", **installed)
    assert "champion_27" in named.stdout
    assert "Drift for ten minutes." in run_python(*pipeline, "--help", **installed).stdout


@pytest.mark.parametrize("kind", ["wheel", "editable"])
def test_an_installer_finds_the_toolkit_in_the_sources_and_by_its_version_elsewhere(
    kind, tmp_path, monkeypatch
):
    prepare = getattr(build_backend, f"prepare_metadata_for_build_{kind}")
    monkeypatch.chdir(PROJECT)

    def required() -> str:
        metadata = tmp_path / prepare(str(tmp_path)) / "METADATA"
        names = Parser().parsestr(metadata.read_text(encoding="utf-8")).get_all("Requires-Dist")
        return next(name for name in names if name.startswith("fis-tools"))

    assert Requirement(required()).url == (PROJECT / "fis_tools").as_uri()
    monkeypatch.setattr(build_backend, "TOOLKIT", tmp_path)  # as in a source distribution, which has none
    assert Requirement(required()).specifier == f"=={maker.product_version()}"


class Alone:
    """The toolkit and what it declares to need, as it lies here, and no other package."""

    def __init__(self, site: Path, wheel: Path) -> None:
        self.site = site
        zipfile.ZipFile(wheel).extractall(site)
        (metadata,) = site.glob("fis_tools-*.dist-info/METADATA")
        self._declared = Parser().parsestr(metadata.read_text(encoding="utf-8")).get_all("Requires-Dist", [])
        self.distributions: dict[str, importlib.metadata.Distribution] = {}
        self.distributions = self.install("", site)

    def install(self, extra: str, site: Path) -> dict[str, importlib.metadata.Distribution]:
        """Link into a folder what the toolkit declares to need for an extra of it, but for what it has."""
        had, waiting = dict(self.distributions), _applying(self._declared, {extra})
        while waiting:
            wanted = waiting.pop()
            if wanted.name not in had:
                results = had[wanted.name] = importlib.metadata.distribution(wanted.name)
                assert wanted.specifier.contains(results.version)
                for name in {file.parts[0] for file in results.files or []} - {"..", "__pycache__"}:
                    (site / name).symlink_to(results.locate_file(name))
                waiting += _applying(results.requires or [], wanted.extras or {""})
        return had

    def size_mb(self) -> float:
        """What all of it weighs, without what Python compiles."""
        files_here = [path for path in self.site.rglob("*") if path.is_file()]
        others = [
            Path(entry.locate_file(file)) for entry in self.distributions.values() for file in entry.files
        ]
        files = (path for path in files_here + others if path.suffix != ".pyc" and path.is_file())
        return sum(path.stat().st_size for path in files) / 1e6

    def run(self, *words: object, beside: Path | None = None) -> subprocess.CompletedProcess[str]:
        """Run Python, which sees another folder of packages beside its own if there is one."""
        path = os.pathsep.join(map(str, filter(None, (beside, self.site))))
        return run_python("-S", *words, folder=self.site, path=path)

    def tools(self, *commands: Sequence[object], code: int = 0, beside: Path | None = None) -> list[str]:
        """What commands print that end with a code, each in turn, in one process."""
        program = TOOLS.format(commands=[list(map(str, words)) for words in commands], code=code)
        return self.run("-c", program, beside=beside).stdout.split(END)[:-1]


FORMS = ("markdown", "csv", "html", "latex", "json", "c")
END = "end of a command"
TOOLS = f"""
import sys
from fis_tools.__main__ import main
sys.stderr = sys.stdout if {{code}} else sys.stderr
for words in {{commands}}:
    assert main(words) == {{code}}, words
    print({END!r}, end="")
"""


def _applying(texts: Iterable[str], extras: set[str]) -> list[Requirement]:
    """The requirements that hold on this machine for one of the extras; the empty one stands for none."""
    wanted = [(entry, entry.marker) for entry in map(Requirement, texts)]
    return [
        entry for entry, rule in wanted if rule is None or any(rule.evaluate({"extra": e}) for e in extras)
    ]


@pytest.fixture(scope="module")
def alone(small_wheel, tmp_path_factory):
    return Alone(tmp_path_factory.mktemp("alone"), small_wheel)


def test_the_toolkit_alone_is_small_and_sees_nothing_else(alone, capsys):
    size = alone.size_mb()
    with capsys.disabled():
        print(f"\nfis-tools with {', '.join(sorted(alone.distributions))}: {size:.0f} MB")  # noqa: T201
    assert size < MOST_MB
    look = "import importlib.util as u; print([n for n in %r if u.find_spec(n)])"
    others = ["pipeline", "telemetry", "scipy", "skfuzzy", "matplotlib", "numba", "pyarrow", "hydra", "mcap"]
    assert alone.run("-c", look % others).stdout == "[]\n"


@pytest.fixture(scope="module")
def fast(alone, tmp_path_factory):
    folder = tmp_path_factory.mktemp("fast")
    alone.install("fast", folder)
    return folder


def test_the_toolkit_answers_the_same_with_numba_and_without(alone, fast):
    commands = [(command, EXAMPLES / "tipper.fis") for command in ("surface", "bounds")]
    assert alone.tools(*commands) == alone.tools(*commands, beside=fast)


def test_the_toolkit_alone_runs_every_command(alone, fast, tmp_path):
    systems = [EXAMPLES / name for name in ("tipper.fis", "dimmer.fll", "pendulum.yaml")]
    commands = []
    for system in systems:
        imported, simpler = (tmp_path / f"{system.stem}-{kind}.yaml" for kind in ("own", "simpler"))
        inputs = [f"{v.name}={0.5 * (v.minimum + v.maximum)}" for v in load(system).systems[0].inputs]
        commands += [
            ("import", system, "-o", imported),
            *((command, system) for command in ("show", "audit")),
            *((command, imported) for command in ("bounds", "surface")),
            ("explain", imported, "--inputs", ",".join(inputs)),
            *(("export", imported, "--format", form) for form in FORMS),
            ("simplify", imported, "--max-change", "5%", "-o", simpler),
            ("diff", imported, simpler),
            ("review", imported, "-o", tmp_path / f"{system.stem}.html"),
        ]
    printed = alone.tools(*commands, beside=fast)
    assert all(words for words, command in zip(printed, commands, strict=True) if "-o" not in command)
    assert all((tmp_path / f"{system.stem}.html").stat().st_size > 10_000 for system in systems)


def test_the_toolkit_alone_says_what_to_install(alone, tmp_path):
    flight, system = tmp_path / "flight.mcap", EXAMPLES / "tipper.fis"
    flight.touch()
    changed = tmp_path / "changed.fis"
    changed.write_text(system.read_text(encoding="utf-8").replace("[1.5 0]", "[2.5 0]"), encoding="utf-8")
    drawing = [
        ("plot", system),
        ("surface", system, "-o", tmp_path / "surface.png"),
        ("diff", system, changed, "-o", tmp_path / "diff.html"),
    ]
    *drawn, shown = alone.tools(*drawing, ("show", flight), code=2)
    cure = " needs {}, which is not installed; install it: python -m pip install {}\n"
    assert all(printed.endswith(cure.format("matplotlib", "matplotlib")) for printed in drawn)
    whole = ". (in a copy of this project's sources)"
    assert shown.endswith(cure.format("the package telemetry", whole))
    assert shown.count("\n") == 1
    compiling = "import fis_tools\ntry: fis_tools.compile(1)\nexcept fis_tools.MissingExtra as e: print(e)"
    assert alone.run("-c", compiling).stdout.endswith("pip install scikit-fuzzy networkx packaging scipy\n")


def test_the_extras_of_the_toolkit_bring_what_they_say(alone, tmp_path):
    extras, figures = tmp_path / "extras", tmp_path / "figures"
    extras.mkdir()
    assert alone.install("all", extras).keys() > alone.distributions.keys()
    alone.tools(("plot", EXAMPLES / "tipper.fis", "-o", figures), beside=extras)
    assert list(figures.glob("*.png"))
    code = (
        f"import sys; sys.path.insert(0, {str(EXAMPLES)!r})\nimport fis_tools\n"
        "from tipping import build_tipping\n"
        "print(fis_tools.compile(build_tipping())({'quality': 6.5, 'service': 9.8})['tip'])"
    )
    assert 0.0 < float(alone.run("-c", code, beside=extras).stdout) < 25.0
