"""Code of one's own: the package of the guide is installed, and its commands are typed."""

import json
import shutil
import sys
from importlib.metadata import distribution
from pathlib import Path
from types import SimpleNamespace

import pytest

import telemetry
from pipeline.evaluation.assurance.quantities import QUANTITIES, SHIPPED
from pipeline.run import artifacts, configuration, maker, manifests, tables
from pipeline.settings import plugged
from pipeline.settings.stages import STAGES, in_order
from telemetry.file.topics import DEPUTY_STATE
from tests.pipeline.command_line.cases import EVALUATE, use_stages
from tests.programs import run_python
from tests.smoke.pages import PLUGGED, blocks, commands

SMALL = {
    "evaluate": ["duration_s=600", "monte_carlo.num_cases=8"],
    "assure": ["duration_s=600", "assurance.num_cases=30", "assurance.domain_cases=4"],
    "train": ["duration_s=300", "optimizer.population_size=6", "optimizer.generations=2", "stages=[train]"],
}
#: folders of entry points change what is known, which is looked up once
CACHES = (plugged._points, maker.product)


def forget():
    for cache in CACHES:
        cache.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] in ("flybys", "mlflow", "wandb")]:
        del sys.modules[name]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder into which the package of the page is installed."""
    sources, site = tmp_path_factory.mktemp("sources"), tmp_path_factory.mktemp("site")
    (project,), (package, loggers) = blocks(PLUGGED, "toml"), blocks(PLUGGED, "python")
    (sources / "flybys").mkdir()
    (sources / "pyproject.toml").write_text(project)
    (sources / "flybys" / "__init__.py").write_text(package)
    (sources / "flybys" / "loggers.py").write_text(loggers)
    options = ("--no-index", "--no-deps", "--no-build-isolation", "--no-compile")
    run_python("-m", "pip", "install", "-q", *options, "--target", site, sources)
    return site


@pytest.fixture
def installed(site, tmp_path, monkeypatch):
    """A folder in which commands are typed where the package is installed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(site))
    (requirements,) = blocks(PLUGGED, "yaml")
    Path("closing.yaml").write_text(requirements)
    forget()
    yield tmp_path
    monkeypatch.undo()
    forget()


def words_with(part: str) -> list[str]:
    """The words of the only command of the page that has a part, with options that make it small."""
    (words,) = [words[3:] for words in commands(PLUGGED) if words[2] == "pipeline" and part in words]
    (experiment,) = [word.partition("=")[2] for word in words if word.startswith("+experiment=")]
    keys = {word.partition("=")[0] for word in words}
    small = [
        word for word in SMALL[experiment] if word.partition("=")[0] not in keys - {"monte_carlo.num_cases"}
    ]
    return [*(word for word in words if not word.startswith(("monte_carlo", "assurance.num"))), *small]


def test_each_command_of_the_page_is_typed_here():
    typed = {tuple(words[3:]) for words in commands(PLUGGED) if words[2] == "pipeline"}
    source = Path(__file__).read_text(encoding="utf-8")
    parts = ("+extensions.nearest.count=5", "assurance.requirements=closing.yaml", "logger.kind=mlflow")
    assert all(source.count(f'words_with("{part}")') for part in parts)
    assert {words for words in typed if not {*parts, "logger.kind=wandb"}.intersection(words)} == set()


@pytest.mark.slow
def test_the_stage_of_the_guide_runs_among_ours(installed, ran):
    printed = ran(*words_with("+extensions.nearest.count=5"))
    folder = Path(printed.out.strip())
    episodes = tables.read_parquet(folder, artifacts.EPISODES)
    listed = json.loads((folder / "nearest" / "flights.json").read_text())
    nearest = sorted(zip(episodes["min_distance_m"], episodes["case"], strict=True))[:5]
    assert [(each["min_distance_m"], each["case"]) for each in listed] == nearest
    manifest = manifests.read(folder)
    assert manifest["finished_stages"] == ["scenario", "evaluate", "nearest"]
    assert manifest["versions"]["flybys"] == distribution("flybys").version == "1.0"
    assert "nearest/flights.json" in manifest["sha256"]
    assert configuration.read(folder)["extensions"] == {"nearest": {"count": 5}}
    # what was made from files that are no longer there is left to do
    ran("repeat", folder, "evaluate")
    assert manifests.read(folder)["finished_stages"] == ["scenario", "evaluate"]
    ran(f"resume={folder}")
    assert manifests.read(folder)["finished_stages"] == ["scenario", "evaluate", "nearest"]
    (folder / "nearest" / "flights.json").unlink()
    ran("repeat", folder, "nearest")
    assert json.loads((folder / "nearest" / "flights.json").read_text()) == listed


@pytest.mark.slow
def test_the_quantity_of_the_guide_is_judged(installed, ran):
    folder = Path(ran(*words_with("assurance.requirements=closing.yaml"), code=None).out.strip())
    (requirement,) = artifacts.read_json(folder, artifacts.EVIDENCE)["requirements"]
    (recording,) = (folder / artifacts.WORST_FLIGHTS).glob("*.mcap")
    state = telemetry.read(recording)[DEPUTY_STATE]
    closing = [
        -sum(p * v for p, v in zip(at, speed, strict=True)) / sum(p * p for p in at) ** 0.5
        for at, speed in zip(state["position_m"].tolist(), state["velocity_m_s"].tolist(), strict=True)
    ]
    # recordings have single precision
    assert requirement["worst"]["margin"] == pytest.approx(0.5 - max(closing), abs=1e-5)


@pytest.mark.parametrize("kind", ["mlflow", "wandb"])
@pytest.mark.slow
def test_the_loggers_of_the_guide_get_each_generation_once(kind, installed, ran, monkeypatch):
    """With stand-ins for what they log to, which are no dependencies."""
    logged, runs = {}, []

    class Run:
        def __enter__(self):
            return self

        def __exit__(self, *error):
            runs.append("ended")

        def log(self, metrics, step):
            assert step not in logged
            logged[step] = metrics

    def begun(**settings):
        runs.append(settings)
        return Run()

    stand_in = SimpleNamespace(
        set_experiment=lambda name: None,
        start_run=begun,
        log_param=lambda name, value: None,
        log_metrics=Run().log,
        init=begun,
    )
    monkeypatch.setitem(sys.modules, kind, stand_in)
    words = words_with("logger.kind=mlflow") if kind == "mlflow" else words_with("logger.kind=wandb")
    folder = Path(ran(*words, "optimizer.rounds=1", code=None).out.strip())
    logbook = (folder / artifacts.LOGBOOK).read_text().splitlines()
    assert list(logged) == list(range(len(logbook) - 1))
    assert set(logged[0]) == set(logbook[0].split(","))
    assert runs[-1] == "ended"
    assert "spring" in str(runs[0])


def test_a_logger_in_a_folder_is_not_called(installed, ran, monkeypatch):
    called = use_stages(monkeypatch)
    ran(*EVALUATE, "logger.kind=mlflow", "hydra.run.dir=run")
    assert called[-1][1].logger.kind == "mlflow"
    assert configuration.read(Path("run"))["logger"]["kind"] == "mlflow"
    for given, kind in (((), "none"), (("logger.kind=mlflow",), "mlflow")):
        manifest = Path("run", "manifest.json")
        content = json.loads(manifest.read_text())
        manifest.write_text(json.dumps(content | {"finished_stages": []}))
        ran("resume=run", *given)
        assert called[-1][1].logger.kind == kind
    ran("again", "run")
    assert called[-1][1].logger.kind == "none"


def test_a_logger_that_fails_is_told_once_and_the_training_goes_on(installed, monkeypatch, capsys):
    from pipeline.command_line.config import compose_experiment  # noqa: PLC0415
    from pipeline.training.progress import logged  # noqa: PLC0415

    def broken():
        raise OSError("the server is gone")

    stand_in = SimpleNamespace(set_experiment=lambda name: broken())
    monkeypatch.setitem(sys.modules, "mlflow", stand_in)
    experiment = compose_experiment(["+experiment=train", "logger.kind=mlflow"]).experiment
    with logged(experiment, installed) as log:
        log([{"best": 1.0}])
        log([{"best": 1.0}, {"best": 0.5}])
    said = capsys.readouterr().err
    assert said.count("logger.kind=mlflow failed (OSError: the server is gone)") == said.count("note") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["stages=[scenario,nearst]"], "did you mean nearest?"),
        (["stages=[nearest,evaluate,scenario]"], "your own may stand anywhere"),
        (
            ["+extensions.nearst.count=5"],
            "extensions.nearst is of no stage of your own; did you mean nearest?",
        ),
        (["extensions.nearest.count=5"], "write +extensions..., with a plus"),
        (["logger.kind=mlflo"], "did you mean mlflow?"),
    ],
)
def test_mistakes_are_told(words, message, installed, ran):
    assert message in ran(*EVALUATE, *words, code=2).err
    assert not Path("outputs").exists()


def test_what_cannot_be_imported_is_refused_where_it_is_named(installed, site, ran, monkeypatch):
    broken = installed / "broken"
    shutil.copytree(site, broken)
    (broken / "flybys" / "__init__.py").write_text("import not_there")
    monkeypatch.syspath_prepend(str(broken))
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(site)])
    forget()
    use_stages(monkeypatch)
    ran(*EVALUATE)
    said = ran(*EVALUATE, "stages=[evaluate,nearest]", code=2).err
    assert "nearest of the package flybys cannot be imported from flybys:nearest (ModuleNotFoundError" in said
    words = ["+experiment=assure", "controller=coast", "assurance.requirements=closing.yaml"]
    assert "closing_speed of the package flybys cannot be imported" in ran(*words, code=2).err
    two = installed / "two"
    shutil.copytree(broken, two)
    (info,) = two.glob("*.dist-info")
    (info / "METADATA").write_text((info / "METADATA").read_text().replace("Name: flybys", "Name: others"))
    info.rename(two / "others-1.0.dist-info")
    monkeypatch.syspath_prepend(str(two))
    forget()
    said = ran(*EVALUATE, "stages=[evaluate,nearest]", code=2).err
    assert "flybys and others offer nearest in the group pipeline.stages; uninstall one" in said


def test_names_that_ship_are_not_taken():
    assert not set(SHIPPED).symmetric_difference(QUANTITIES)
    assert in_order(["scenario", "mine", "evaluate"], "other") == [
        *STAGES[: STAGES.index("scenario") + 1],
        "mine",
        *STAGES[STAGES.index("scenario") + 1 :],
        "other",
    ]
    assert in_order(["mine", "report"])[0] == "mine"
