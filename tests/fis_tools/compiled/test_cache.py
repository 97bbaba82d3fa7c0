"""The cache of compiled code: whose files are loaded, and that nothing about it ends what compiles."""

import os
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fis_tools.compiled import cache
from tests.fis_tools.compiled.kernels import CALL, SOURCES, Package
from tests.programs import program


@pytest.fixture
def package(tmp_path):
    return Package(tmp_path)


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Where compiled code is kept, not made yet."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "own"))
    return tmp_path / "own" / "fis-tools"


@pytest.mark.parametrize(
    ("variables", "root"),
    [
        ({"NUMBA_CACHE_DIR": "/first", "XDG_CACHE_HOME": "/second"}, "/first"),
        ({"XDG_CACHE_HOME": "/second"}, "/second"),
        ({"NUMBA_CACHE_DIR": ""}, "~/.cache"),
    ],
)
def test_the_cache_lies_where_the_environment_says(variables, root, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert cache.cache_root() == Path(root).expanduser() / "fis-tools"


def test_a_file_is_read_as_it_was_written_and_closed_to_others(root):
    path = root / "f.code"
    assert cache.read(path) is None
    cache.write(path, b"code")
    assert cache.read(path) == b"code"
    assert list(root.iterdir()) == [path]
    assert [stat.S_IMODE(part.stat().st_mode) for part in (root, path)] == [0o700, 0o600]


@pytest.mark.parametrize("damage", [lambda data: data[:-1], lambda data: data[:-1] + b"X", lambda data: b""])
def test_a_damaged_file_is_not_used(root, damage):
    path = root / "f.code"
    cache.write(path, b"code")
    path.write_bytes(damage(path.read_bytes()))
    assert cache.read(path) is None


posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="owners and modes are those of POSIX systems")


def refusal() -> str:
    with pytest.raises(cache.NotKeptError, match="set NUMBA_CACHE_DIR to a folder of your own") as error:
        cache.trusted_root()
    return str(error.value)


@posix
@pytest.mark.parametrize("mode", [0o777, 0o702])
def test_a_folder_that_others_may_write_to_is_refused(root, mode):
    root.mkdir(parents=True)
    root.chmod(mode)
    assert f"others may write to {root}" in refusal()
    root.chmod(0o700)
    root.parent.chmod(mode)
    assert f"others may write to {root.parent}" in refusal()
    root.parent.chmod(mode | stat.S_ISVTX)  # as /tmp is: nobody can replace what belongs to another
    assert cache.trusted_root() == root


@posix
@pytest.mark.parametrize("is_private", [True, False])
def test_a_group_may_write_where_nobody_else_is_in_it(root, is_private, monkeypatch):
    import grp  # noqa: PLC0415 - not on every system
    import pwd  # noqa: PLC0415

    user = pwd.getpwuid(os.getuid()).pw_name
    group = grp.struct_group((user, "x", os.getgid(), [user] if is_private else [user, "somebody"]))
    monkeypatch.setattr(grp, "getgrgid", lambda _: group)
    root.mkdir(parents=True)
    root.chmod(0o770)
    if is_private:
        assert cache.trusted_root() == root
    else:
        assert f"others may write to {root}" in refusal()


@posix
def test_a_folder_of_somebody_else_and_a_link_are_refused(root, tmp_path, monkeypatch):
    (tmp_path / "planted").mkdir(mode=0o700)
    root.parent.mkdir()
    root.symlink_to(tmp_path / "planted")
    assert f"{root} is a link" in refusal()
    root.unlink()
    root.mkdir(mode=0o700)
    monkeypatch.setattr(cache, "ROOT_USER", root.stat().st_uid + 2)
    monkeypatch.setattr(os, "getuid", lambda: root.stat().st_uid + 1)
    assert f"{root} belongs to somebody else" in refusal()
    monkeypatch.setattr(cache, "ROOT_USER", root.stat().st_uid)  # warmed by root, as in a container's image
    assert cache.trusted_root() == root


def test_what_was_not_used_for_longest_is_removed_beyond_the_limit(root, monkeypatch):
    monkeypatch.setattr(cache, "LIMIT_BYTES", 3 * (cache.HEAD + 100))
    for number, moment in enumerate((1e9, 1.1e9, 1.2e9)):
        cache.write(root / f"{number}.code", bytes(100))
        os.utime(root / f"{number}.code", (moment, moment))
    (root / "folder").mkdir()
    cache.read(root / "0.code")  # using it keeps it
    cache.write(root / "3.code", bytes(100))
    assert sorted(path.name for path in root.iterdir()) == ["0.code", "2.code", "3.code", "folder"]


def test_what_is_written_while_the_clock_is_behind_stays(root, monkeypatch):
    monkeypatch.setattr(cache, "LIMIT_BYTES", 2 * (cache.HEAD + 100))
    for number in range(3):
        cache.write(root / f"{number}.code", bytes(100))
        os.utime(root / f"{number}.code", (4e9 - number, 4e9 - number))  # in 2096
    cache.write(root / "3.code", bytes(100))
    assert sorted(path.name for path in root.iterdir()) == ["0.code", "3.code"]


@pytest.mark.slow
def test_a_clock_that_jumps_does_no_harm(package):
    """Sources and code of 400 days ahead, and of 400 days ago, are as good as others."""
    assert package.call() == "7 8 0 0"
    for days in (400, -400):
        moment = time.time() + days * 86400.0
        for path in package.folder.rglob("*"):
            os.utime(path, (moment, moment))
        assert package.call() == "7 8 1 1"
        package.write("callee", SOURCES["callee"].replace("x + STEP", f"x * {1000 + days}"))
        assert package.call().split()[0] == str(5 * (1000 + days) ** 2)
        package.write("callee", SOURCES["callee"])


@pytest.mark.slow
def test_a_folder_that_cannot_be_made_is_reported_once_and_ends_nothing(package):
    blocked = package.folder / "blocked"
    blocked.write_text("a file where a folder should be")
    done = package.run(CALL, NUMBA_CACHE_DIR=str(blocked))
    assert done.stdout == "7 8 0 0\n"
    lines = [line for line in done.stderr.splitlines() if "is not kept" in line]
    assert len(lines) == 1
    assert str(blocked / "fis-tools") in lines[0]
    assert "set NUMBA_CACHE_DIR to a folder of your own" in lines[0]
    package.write("callee", SOURCES["callee"].replace("x + STEP", "3 * x + 0"))
    assert package.run(CALL, NUMBA_CACHE_DIR=str(blocked)).stdout == "45 8 0 0\n"
    assert not list(package.folder.rglob("*.nbi"))  # nor beside the sources, as numba's own cache does


def mounting(package: Package, mount: str, variables: str) -> subprocess.CompletedProcess[str]:
    """Call the functions of a package after something is mounted, for these processes alone."""
    (package.folder / "call.py").write_text(CALL)
    words = f"{mount} && {variables} exec {sys.executable} call.py"
    command = [program("unshare", "util-linux"), "--map-root-user", "--mount", "sh", "-c", words]
    environment = os.environ | package.variables
    done = subprocess.run(  # noqa: S603
        command, check=False, cwd=package.folder, env=environment, capture_output=True, text=True
    )
    if "mount" in done.stderr and done.returncode:
        pytest.skip(f"nothing can be mounted here: {done.stderr}")
    assert done.returncode == 0, done.stderr
    return done


@posix
@pytest.mark.slow
def test_a_full_cache_is_left_out_and_reported_once_with_the_name_of_the_file(package):
    (package.folder / "full").mkdir()
    mount = "mount -t tmpfs -o size=4k tmpfs $PWD/full && chmod 700 full && mkdir -m 700 full/fis-tools"
    done = mounting(package, f"{mount} && head -c 4096 /dev/zero >full/filled", "NUMBA_CACHE_DIR=$PWD/full")
    assert done.stdout == "7 8 0 0\n"
    lines = [line for line in done.stderr.splitlines() if "is not kept" in line]
    assert [line.count("No space left on device") for line in lines] == [1]
    assert f"{package.folder}/full/fis-tools/kernels." in lines[0]


@posix
@pytest.mark.slow
def test_a_warm_cache_that_is_read_only_is_read(package):
    assert package.call() == "7 8 0 0"
    done = mounting(package, "mount --bind cache cache && mount -o remount,ro,bind cache", "")
    assert (done.stdout, done.stderr) == ("7 8 1 1\n", "")
    package.write("callee", SOURCES["callee"].replace("x + STEP", "x * 3"))
    done = mounting(package, "mount --bind cache cache && mount -o remount,ro,bind cache", "")
    assert done.stdout == "45 8 0 1\n"
    assert "Read-only file system" in done.stderr
