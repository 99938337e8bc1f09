"""Every command under external faults: one line, the right status, no partial results."""

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from math import inf
from pathlib import Path

import pytest

from orbit_files import oem
from scenarios import GOOD, LOST

pytestmark = pytest.mark.fault
COMMANDS = {
    "run": "run good.toml --out out",
    "check": "check good.toml",
    "study": "study lost.toml --out out",
    "screen": "screen A.oem B.oem --sphere '500 m' --out out",
    "view": "view done",
    "help": "--help",
}
LEAVE = "run", "study", "screen"  # results
CLOSEFORM = [sys.executable, "-m", "closeform"]


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("original")
    (place / "good.toml").write_text(GOOD)
    (place / "lost.toml").write_text(LOST)
    (place / "A.oem").write_text(oem("A", 0.0))
    (place / "B.oem").write_text(oem("B", 1e-4))
    subprocess.run(
        [*CLOSEFORM, "run", "good.toml", "--out", "done"], cwd=place, check=True, capture_output=True
    )
    for name in ("study", "screen"):  # kernels are compiled beforehand
        subprocess.run([*CLOSEFORM, *shlex.split(COMMANDS[name])], cwd=place, check=True, capture_output=True)
        shutil.rmtree(place / "out")
    return place


@pytest.fixture
def desk(original: Path, tmp_path: Path) -> Path:
    shutil.copytree(original, tmp_path / "desk")
    return tmp_path / "desk"


def result_of(desk: Path, arguments: list[str], **options) -> subprocess.CompletedProcess:
    """Run a command without a browser."""
    environment = {**os.environ, "BROWSER": "true", **options.pop("env", {})}
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    done = subprocess.run([*CLOSEFORM, *arguments], cwd=desk, env=environment, **options)
    assert b"Traceback" not in (done.stderr or b"")
    assert not [name for name in os.listdir(desk) if name.startswith(".")]
    return done


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("encoding", ["ascii", "cp437", "latin-1", "utf-16"])
def test_any_output_encoding(command, encoding, desk) -> None:
    """Also with a Chinese name and a path that is not valid text."""
    (desk / "good.toml").write_text(GOOD.replace("Three craft", "三 craft in m³"), encoding="utf-8")
    done = result_of(desk, shlex.split(COMMANDS[command]), env={"PYTHONIOENCODING": encoding})
    assert (done.returncode, done.stderr) == (0, b"")
    text = done.stdout.decode(encoding)
    if command == "run":
        title = {"utf-16": "三 craft in m³", "latin-1": "\\u4e09 craft in m³"}
        assert text.splitlines()[0] == title.get(encoding, "\\u4e09 craft in m3")


@pytest.mark.parametrize("command", COMMANDS)
def test_closed_pipe(command, desk) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = result_of(desk, shlex.split(COMMANDS[command]), stdout=writer)
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, b"")
    assert (desk / "out" / "summary.json").exists() == (command in LEAVE)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("command", COMMANDS)
def test_output_on_a_full_disk(command, desk) -> None:
    with Path("/dev/full").open("w") as full:
        done = result_of(desk, shlex.split(COMMANDS[command]), stdout=full)
    assert (done.returncode, done.stderr) == (74, b"closeform: standard output: no space left on device\n")
    assert (desk / "out" / "summary.json").exists() == (command in LEAVE)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("closed", [1, 2])
def test_closed_streams(command, closed, desk) -> None:
    done = result_of(desk, shlex.split(COMMANDS[command]), preexec_fn=lambda: os.close(closed))
    assert done.returncode == 0
    assert (done.stdout == b"") == (closed == 1)


@pytest.mark.parametrize("command", COMMANDS)
def test_unknown_matplotlib_backend(command, desk) -> None:
    done = result_of(desk, shlex.split(COMMANDS[command]), env={"MPLBACKEND": "nosuch"})
    assert (done.returncode, done.stderr) == (0, b"")


def too_long(desk: Path, file: Path) -> str:
    return "x" * 300


def loop(desk: Path, file: Path) -> str:
    (desk / "loop").symlink_to("loop")
    return "loop"


def huge_number(desk: Path, file: Path) -> str:
    file.write_text(file.read_text() + f"\nx = {'9' * 5000}\n")
    return file.name


def many_dots(desk: Path, file: Path) -> str:
    file.write_text(f"{'.'.join('a' * 2000)} = 1\n" + file.read_text())
    return file.name


def dots_in_a_value(desk: Path, file: Path) -> str:
    file.write_text(file.read_text().replace("[orbit]\n", f"[orbit]\nmu.{'.'.join('a' * 2000)} = 1\n"))
    return file.name


def nested(desk: Path, file: Path) -> str:
    file.write_text(file.read_text().replace("[orbit]\n", f"[orbit]\nmu = {'[' * 5000}{']' * 5000}\n"))
    return file.name


def nothing(desk: Path, file: Path) -> str:
    file.write_bytes(b"\0" * 100)
    return file.name


INPUTS = (too_long, loop, huge_number, many_dots, dots_in_a_value, nested, nothing)


@pytest.mark.parametrize(
    ("command", "attack"),
    [
        (command, attack)
        for command in ("run", "check", "study", "screen", "view")
        for attack in INPUTS
        if command != "screen" or attack not in (dots_in_a_value, nested)  # an ephemeris has no table
    ],
)
def test_unreadable_inputs(command, attack, desk) -> None:
    verb, name, *rest = shlex.split(COMMANDS[command])
    file = desk / (name if name != "done" else "done/summary.json")
    name = attack(desk, file)
    done = result_of(desk, [verb, name, *rest])
    assert done.returncode == 2
    assert done.stdout == b""
    lines = done.stderr.decode().splitlines()
    assert len(lines) == 1, lines
    assert "; " in lines[0]  # a remedy
    assert not (desk / "out").exists()


@pytest.mark.parametrize("command", ["run", "study"])
@pytest.mark.parametrize("attack", [too_long, loop])
def test_unusable_output_folders(command, attack, desk) -> None:
    verb, name, *_ = shlex.split(COMMANDS[command])
    done = result_of(desk, [verb, name, "--out", attack(desk, desk)])
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr.decode().endswith("; choose another --out\n")


@pytest.mark.parametrize("command", COMMANDS)
def test_byte_order_mark_is_accepted(command, desk) -> None:
    for file in (*desk.glob("*.toml"), *desk.glob("*.oem")):
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    done = result_of(desk, shlex.split(COMMANDS[command]))
    assert (done.returncode, done.stderr) == (0, b"")
    if command == "run":
        assert (desk / "out" / "scenario.toml").read_bytes() == (desk / "good.toml").read_bytes()


def as_nobody(desk: Path, arguments: list[str]) -> subprocess.CompletedProcess:
    if os.geteuid() != 0 or shutil.which("setpriv") is None:
        pytest.skip("needs root and setpriv to become somebody else")
    for folder in desk.parents:
        if folder.stat().st_uid == 0 and not folder.stat().st_mode & 1:
            folder.chmod(folder.stat().st_mode | 0o711)
    drop = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}  # no kernels of its own
    return subprocess.run(
        [*drop, *CLOSEFORM, *arguments], cwd=desk, env=environment, capture_output=True, text=True
    )


@pytest.mark.parametrize("command", ["run", "check", "study", "screen", "view"])
def test_folders_without_permission(command, desk) -> None:
    """Folders of inputs and of results."""
    verb, name, *rest = shlex.split(COMMANDS[command])
    (desk / "closed").mkdir()
    shutil.move(desk / name, desk / "closed" / name)
    (desk / "closed").chmod(0)
    attempts = [[verb, f"closed/{name}", *rest]]
    if command in ("run", "study"):
        (desk / name).write_text((GOOD, LOST)[command == "study"])
        attempts += [[verb, name, "--out", "closed"], [verb, name, "--out", "closed/out"], [verb, name]]
    desk.chmod(0o555)
    for arguments in attempts:
        done = as_nobody(desk, arguments)
        assert (done.returncode, done.stdout) == (2, ""), (arguments, done.stderr)
        assert len(done.stderr.splitlines()) == 1, done.stderr
        assert "; " in done.stderr


@pytest.mark.parametrize("command", ["run", "study", "check", "screen"])
def test_interrupt_at_any_moment(command, desk) -> None:
    """At eight moments a command ends with 130 and one line, unless it had finished."""
    lasts = inf
    for _ in range(2):  # the shorter one, because the machine may be busy
        begun = time.monotonic()
        result_of(desk, shlex.split(COMMANDS[command]))
        lasts = min(lasts, time.monotonic() - begun)
        shutil.rmtree(desk / "out", ignore_errors=True)
    interrupted = 0
    for moment in range(8):
        with subprocess.Popen(
            [*CLOSEFORM, *shlex.split(COMMANDS[command])],
            cwd=desk,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        ) as process:
            time.sleep(0.25 + moment / 7 * max(0.1, lasts - 0.25))  # Python has started by then
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate()
        left = {name for name in os.listdir(desk) if name.startswith(".") or name == "out"}
        if process.returncode == 0:
            assert errors == b""
        else:
            interrupted += 1
            # Python may end by the signal itself, which is 130 in a shell
            assert process.returncode in (130, -signal.SIGINT), errors
            assert errors.startswith(b"closeform: stopped by the keyboard; ")
            assert errors.count(b"\n") == 1
        done = process.returncode == 0 or b"results in out" in errors
        assert left == ({"out"} if done and command != "check" else set())
        if left:
            assert (desk / "out" / "summary.json").is_file()
            shutil.rmtree(desk / "out")
    assert interrupted >= 3
