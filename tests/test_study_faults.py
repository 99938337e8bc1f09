"""Studies in killed processes and on full disks: rows equal those of an undisturbed study."""

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from closeform.campaign import cluster
from closeform.campaign.cluster import Cluster, ClusterError
from studies import S04

pytestmark = pytest.mark.fault
CASES = 4_000_000  # forty chunks: some seconds
FAR = re.compile(rf"[\d,]+ of {CASES:,} cases, [\d,]+/s, [\d,]+ s left, 0 not met")
KILLS = 7  # of the study, of workers and, less one, of the scheduler: twenty in all
CLOSEFORM = [sys.executable, "-m", "closeform"]
STUDY = [*CLOSEFORM, "study", "s04.toml", "--cases", str(CASES), "--out", "out"]


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the results of an undisturbed study."""
    place = tmp_path_factory.mktemp("original")
    lines = S04.read_text().splitlines(keepends=True)
    (place / "s04.toml").write_text("".join(line for line in lines if not line.startswith("sampled")))
    subprocess.run([*STUDY[:-1], "undisturbed"], cwd=place, check=True, capture_output=True)
    return place


@pytest.fixture
def desk(original: Path, tmp_path: Path) -> Path:
    shutil.copy(original / "s04.toml", tmp_path)
    return tmp_path


def same(original: Path, desk: Path) -> None:
    """Hold every row of a study against the undisturbed one: its files are the same to the last byte."""
    theirs, ours = (sorted((place / "cases").iterdir()) for place in (original / "undisturbed", desk / "out"))
    assert [file.name for file in ours] == [file.name for file in theirs]
    for one, other in zip(theirs, ours, strict=True):
        assert one.read_bytes() == other.read_bytes()
    summaries = [(place / "summary.json").read_text() for place in (original / "undisturbed", desk / "out")]
    assert summaries[0] == summaries[1]
    assert not (desk / "out" / ".unfinished").exists()


def whole(desk: Path) -> int:
    """How many chunks the manifest lists."""
    try:
        return max(0, len((desk / "out" / ".unfinished" / "manifest.jsonl").read_bytes().splitlines()) - 1)
    except OSError:
        return 0


def until(holds: Callable[[], object], patience: float = 60.0) -> None:
    """Wait for something."""
    end = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


def goes_on(kept: int) -> list[str]:
    """Return the reported number of finished chunks, if there are some."""
    return [f"out: continuing, {kept * (CASES // 40)} of {CASES} cases are complete"] if kept else []


def said(err: str) -> list[str]:
    """Return the standard error of a study without its progress lines."""
    return [line for line in err.splitlines() if not FAR.fullmatch(line)]


def begun(desk: Path, *options: str) -> subprocess.Popen:
    return subprocess.Popen(
        [*STUDY, *options], cwd=desk, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def test_killed_study_continues(original: Path, desk: Path) -> None:
    rng = np.random.default_rng(1)
    kept = 0
    for _ in range(KILLS):
        study = begun(desk)
        ahead = kept + int(rng.integers(1, 5))  # at a random moment after a few more chunks
        until(lambda study=study, ahead=ahead: whole(desk) >= ahead or study.poll() is not None)
        time.sleep(rng.uniform(0.0, 0.05))
        study.kill()
        study.communicate()
        assert study.returncode == -signal.SIGKILL
        assert whole(desk) >= ahead  # finished chunks are kept
        kept = whole(desk)
    assert kept < CASES // 100_000
    assert subprocess.run(STUDY, cwd=desk, capture_output=True).returncode == 0
    same(original, desk)


class Machines:
    """A scheduler and two workers, each a process of its own."""

    def __init__(self, desk: Path, tls: tuple[str, ...] = (), scheme: str = "tcp") -> None:
        pytest.importorskip("distributed")
        self.desk, self.tls, self.scheme = desk, tls, scheme
        self.file = desk / "scheduler.json"
        self.workers: list[subprocess.Popen] = []
        self.begin()

    def process(self, *arguments: str) -> subprocess.Popen:
        command = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:], *self.tls]
        return subprocess.Popen(command, cwd=self.desk, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def begin(self) -> None:
        self.file.unlink(missing_ok=True)
        where = ("--host", f"{self.scheme}://127.0.0.1", "--port", "0")
        self.scheduler = self.process(
            "dask_scheduler", *where, "--no-dashboard", "--scheduler-file", str(self.file)
        )
        until(self.file.exists)
        self.workers = [self.worker(), self.worker()]

    def worker(self) -> subprocess.Popen:
        return self.process(
            "dask_worker",
            "--scheduler-file",
            str(self.file),
            "--nthreads",
            "1",
            "--no-dashboard",
            "--no-nanny",
        )

    def end(self) -> None:
        for one in (*self.workers, self.scheduler):
            one.kill()
            one.wait()


@pytest.fixture
def machines(desk: Path) -> Iterator[Machines]:
    found = Machines(desk)
    yield found
    found.end()


def test_killed_workers_change_no_result(original: Path, desk: Path, machines: Machines) -> None:
    rng = np.random.default_rng(2)
    study = begun(desk, "--scheduler", str(machines.file))
    kept = 0
    for kill in range(KILLS):
        ahead = kept + int(rng.integers(1, 4))
        until(lambda ahead=ahead: whole(desk) >= ahead or study.poll() is not None)
        assert study.poll() is None, study.communicate()
        victim = kill % 2
        machines.workers[victim].kill()
        machines.workers[victim].wait()
        machines.workers[victim] = machines.worker()
        kept = whole(desk)
    out, err = study.communicate(timeout=300)
    assert (study.returncode, said(err)) == (0, []), out
    same(original, desk)


def test_lost_chunk_is_evaluated_again(machines: Machines) -> None:
    """A worker is killed after evaluating a task, before its result is fetched."""
    with Cluster(str(machines.file)) as cluster:
        until(lambda: cluster.threads() == 2)
        future = cluster.client.submit(lambda: time.sleep(3.0) or "flown", pure=False)
        begin = time.monotonic()
        assert cluster.ended([future]) == []
        assert time.monotonic() - begin > 0.9  # it waits, and asks no scheduler meanwhile
        until(lambda: future.status == "finished")
        (holder,) = cluster.client.who_has(future)[future.key]
        os.kill(cluster.client.run(os.getpid, workers=[holder])[holder], signal.SIGKILL)
        until(lambda: future.status == "lost")
        assert cluster.ended([future]) == []
        until(lambda: cluster.ended([future]))
        assert cluster.answer(future) == "flown"


def test_loss_of_all_workers_is_detected(machines: Machines, monkeypatch) -> None:
    """After the patience that is stated, and it is not the scheduler that is blamed."""
    monkeypatch.setattr(cluster, "PATIENCE", 3.0)
    with Cluster(str(machines.file)) as client:
        until(lambda: client.threads() == 2)
        future = client.client.submit(lambda: "flown", pure=False)
        until(lambda: future.status == "finished")
        for worker in machines.workers:
            worker.kill()
            worker.wait()
        begin = time.monotonic()
        with pytest.raises(ClusterError, match="has no workers; start some"):
            client.answer(future)
        assert time.monotonic() - begin < 10.0


def test_killed_scheduler_is_reported_in_one_line(original: Path, desk: Path, machines: Machines) -> None:
    rng = np.random.default_rng(3)
    kept = 0
    for _ in range(KILLS - 1):
        study = begun(desk, "--scheduler", str(machines.file))
        ahead = kept + int(rng.integers(1, 4))
        until(lambda study=study, ahead=ahead: whole(desk) >= ahead or study.poll() is not None)
        machines.end()
        _, err = study.communicate(timeout=120)
        assert study.returncode == 2
        *before, line = said(err)
        assert before == goes_on(kept)
        assert line.startswith(f"--scheduler: {machines.file} no longer responds; start it again; ")
        assert line.endswith(f"{whole(desk)} of 40 chunks are kept in out; run the same command to continue")
        assert whole(desk) >= ahead
        kept = whole(desk)
        machines.begin()
    study = begun(desk, "--scheduler", str(machines.file))
    out, err = study.communicate(timeout=300)
    assert (study.returncode, said(err)) == (0, goes_on(kept)), out
    same(original, desk)


def test_certificates_are_used(original: Path, desk: Path, monkeypatch) -> None:
    """tls:// with an own authority: the study runs with its certificate, and fails in one line without."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")
    make = [
        "openssl",
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-keyout",
        "key.pem",
        "-out",
        "ca.pem",
    ]
    subprocess.run([*make, "-subj", "/CN=127.0.0.1", "-days", "2"], cwd=desk, check=True, capture_output=True)
    tls = ("--tls-ca-file", "ca.pem", "--tls-cert", "ca.pem", "--tls-key", "key.pem")
    machines = Machines(desk, tls, "tls")
    try:
        alone = begun(desk, "--scheduler", str(machines.file))
        _, err = alone.communicate(timeout=60)
        assert alone.returncode == 2
        assert err.endswith("needs certificates; name them in Dask's configuration, distributed.comm.tls\n")
        for name, file in (("CA_FILE", "ca.pem"), ("CLIENT__CERT", "ca.pem"), ("CLIENT__KEY", "key.pem")):
            monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{name}", file)
        study = begun(desk, "--scheduler", str(machines.file))
        out, err = study.communicate(timeout=300)
        assert (study.returncode, said(err)) == (0, []), out
        same(original, desk)
    finally:
        machines.end()


def test_full_disk_keeps_finished_chunks(original: Path, desk: Path) -> None:
    """A file system of 60 MB; after it is made larger the same command goes on."""
    disk = desk / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=60m", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("needs leave to mount a tmpfs")
    try:
        shutil.copy(desk / "s04.toml", disk)
        study = subprocess.run(STUDY, cwd=disk, capture_output=True, text=True)
        assert study.returncode == 2
        (line,) = study.stderr.splitlines()
        assert line.startswith(f"out: no space left on device; {whole(disk)} of 40 chunks are kept in out; ")
        assert whole(disk) > 3
        subprocess.run(["mount", "-o", "remount,size=2g", str(disk)], check=True)
        assert subprocess.run(STUDY, cwd=disk, capture_output=True).returncode == 0
        same(original, disk)
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=False)  # compiling may go on in it


def test_file_size_limit_keeps_finished_chunks(original: Path, desk: Path) -> None:
    """Where no file system can be filled: no file may be longer than 3 MB, a chunk is."""
    limits = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (3_000_000, 3_000_000))  # noqa: E731
    study = subprocess.run(STUDY, cwd=desk, capture_output=True, text=True, preexec_fn=limits)
    assert (study.returncode, study.stderr) == (2, "out: file too large; choose another --out\n")
    assert not (desk / "out").exists()
    assert subprocess.run(STUDY, cwd=desk, capture_output=True).returncode == 0
    same(original, desk)


def test_two_studies_in_a_folder(desk: Path) -> None:
    study = begun(desk)
    until(lambda: whole(desk) > 0)
    other = subprocess.run(STUDY, cwd=desk, capture_output=True, text=True)
    assert other.returncode == 2
    assert "is under way in it; wait for its end" in other.stderr
    study.send_signal(signal.SIGINT)
    _, err = study.communicate(timeout=60)
    assert study.returncode == 130
    assert err.startswith("closeform: stopped by the keyboard; ")
    assert f"{whole(desk)} of 40 chunks are kept in out; run the same command to continue" in err
