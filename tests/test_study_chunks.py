"""Studies in chunks: interruption and continuation, exact statistics from files, remote tasks."""

import json
import pickle
import re
import tracemalloc
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from closeform.campaign import case_of, chunks, evaluated, search_cases, spread
from closeform.campaign.campaign import kind_of
from closeform.campaign.chunks import Chunk, Stored, versions
from closeform.campaign.cluster import ClusterError, evaluate
from closeform.campaign.spread import Spread, order_statistics
from closeform.cli.app import main
from closeform.scenario import ScenarioError, load, parse
from closeform.search.lock_statistics import TimeHistogram
from studies import EXAMPLES, GATHERING, NARROW, S04

pytestmark = pytest.mark.usefixtures("undrawn")

STUDY = ["study", "narrow.toml", "--out", "out"]


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study of six chunks of fifty cases."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(search_cases, "PAIRS_AT_ONCE", 100)
    (tmp_path / "narrow.toml").write_text(NARROW)
    return tmp_path


@pytest.fixture(scope="module")
def undisturbed(undrawn: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the results of the study without an interruption."""
    place = tmp_path_factory.mktemp("undisturbed")
    (place / "narrow.toml").write_text(NARROW)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.setattr(search_cases, "PAIRS_AT_ONCE", 100)
        assert main(STUDY) == 1
    return place / "out"


def stopped(monkeypatch: pytest.MonkeyPatch, after: int, error: BaseException) -> int:
    """Return the status of the study if it stops after some chunks."""
    take = Stored.take

    def failing(self: Stored, one: Chunk) -> None:
        if len(self.whole) == after:
            raise error
        take(self, one)

    with monkeypatch.context() as patched:
        patched.setattr(Stored, "take", failing)
        return main(STUDY)


def rows(place: Path) -> dict[str, bytes]:
    """Return the files of cases by name."""
    return {file.name: file.read_bytes() for file in sorted((place / "cases").iterdir())}


def flown_ranges(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list of the first cases of all chunks evaluated from now on."""
    found, of = [], Chunk.of
    monkeypatch.setattr(
        Chunk, "of", lambda cases, first, last: (found.append(first), of(cases, first, last))[1]
    )
    return found


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (
            KeyboardInterrupt(),
            130,
            "stopped by the keyboard; 3 of 6 chunks are kept in out; run the same command",
        ),
        (
            OSError(28, "No space left on device"),
            2,
            "out: no space left on device; 3 of 6 chunks are kept in out",
        ),
    ],
)
def test_interrupted_study_continues(error, status, said, undisturbed, desk, monkeypatch, capsys) -> None:
    whole = rows(undisturbed)
    assert list(whole) == [f"{first:09d}.parquet" for first in range(0, 300, 50)]
    assert stopped(monkeypatch, 3, error) == status
    assert said in capsys.readouterr().err
    assert not (desk / "out" / "summary.json").exists()
    assert main(["run", "narrow.toml", "--case", "1", "--out", "out"]) == 2  # a run does not replace it
    assert "out: holds an unfinished study; continue it, add --overwrite" in capsys.readouterr().err
    assert main(["view", "out"]) == 2
    told = (
        "out: holds an unfinished study, 3 of 6 chunks are complete; "
        "run the same closeform study command to continue\n"
    )
    assert capsys.readouterr().err == told
    again = flown_ranges(monkeypatch)
    assert main(STUDY) == 1
    assert len(again) == 3
    assert rows(desk / "out") == whole
    one, other = (json.loads((place / "summary.json").read_text()) for place in (desk / "out", undisturbed))
    assert one == other
    assert sorted(file.name for file in desk.iterdir()) == ["narrow.toml", "out"]
    assert not (desk / "out" / ".unfinished").exists()


def test_finished_study_returns_its_status_again(desk, monkeypatch, capsys) -> None:
    """The same command does nothing more; another study is refused."""
    assert main(STUDY) == 1
    last = capsys.readouterr().out.splitlines()[-1]
    again = flown_ranges(monkeypatch)
    assert main(STUDY) == 1
    told = capsys.readouterr()
    assert told.out.splitlines() == [last]
    assert told.err.startswith("out: ")
    assert again == []
    for other in (["--seed", "8"], ["--cases", "200"]):
        assert main([*STUDY, *other]) == 2
        assert "out: holds finished results" in capsys.readouterr().err
    assert main([*STUDY, "--overwrite"]) == 1
    assert len(again) == 6


def test_overwrite_replaces_an_unfinished_study(desk, monkeypatch, capsys) -> None:
    """Also if that study was to replace finished results."""
    assert main(STUDY) == 1
    with monkeypatch.context() as patched:
        patched.setattr("test_study_chunks.STUDY", [*STUDY, "--seed", "8", "--overwrite"])
        assert stopped(monkeypatch, 2, KeyboardInterrupt()) == 130
    assert main([*STUDY, "--seed", "9", "--overwrite"]) == 1
    summary = json.loads((desk / "out" / "summary.json").read_text())
    assert (summary["seed"], len(rows(desk / "out"))) == (9, 6)
    assert sorted(summary["files"]) == sorted(
        file.relative_to(desk / "out").as_posix() for file in (desk / "out").rglob("*") if file.is_file()
    )


@pytest.mark.parametrize(
    ("options", "what"),
    [
        (["--seed", "8"], "seed 7, not 8"),
        ([], "another scenario; repeat"),
    ],
)
def test_different_study_is_refused(options, what, desk, monkeypatch, capsys) -> None:
    assert stopped(monkeypatch, 2, KeyboardInterrupt()) == 130
    if not options:
        (desk / "narrow.toml").write_text(NARROW.replace("5 cm/s", "6 cm/s"))
    manifest = desk / "out" / ".unfinished" / "manifest.jsonl"
    before = rows(desk / "out" / ".unfinished" / "results"), manifest.read_text()
    capsys.readouterr()
    assert main([*STUDY, *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"out: holds 2 chunks of an unfinished study of {what}")
    assert line.endswith("; repeat the same study to continue it, or add --overwrite to start again")
    assert before == (rows(desk / "out" / ".unfinished" / "results"), manifest.read_text())
    assert main([*STUDY, *options, "--overwrite"]) == 1
    assert json.loads((desk / "out" / "summary.json").read_text())["cases"] == 300


def test_damaged_chunk_is_evaluated_again(undisturbed, desk, monkeypatch, capsys) -> None:
    assert stopped(monkeypatch, 4, KeyboardInterrupt()) == 130
    private = desk / "out" / ".unfinished"
    spoilt, *_ = sorted((private / "results" / "cases").iterdir())
    data = bytearray(spoilt.read_bytes())
    data[len(data) // 2] ^= 1
    spoilt.write_bytes(data)
    with (private / "manifest.jsonl").open("a") as manifest:
        manifest.write('{"first": 2')  # a kill cut it off
    capsys.readouterr()
    again = flown_ranges(monkeypatch)
    assert main(STUDY) == 1
    damaged, going_on = capsys.readouterr().err.splitlines()
    assert damaged == f"out: {spoilt.name} is damaged or missing, and is evaluated again"
    assert re.fullmatch(r"out: continuing, [1-9]\d* of \d+ cases are complete", going_on)
    assert len(again) == 3
    assert int(spoilt.stem) in again
    assert rows(desk / "out") == rows(undisturbed)


@pytest.mark.parametrize("kept", [3, "all"])
def test_kill_during_publication_loses_nothing(kept, undisturbed, desk, monkeypatch) -> None:
    """The process ends after three or all files of cases are published."""
    real, moved = Path.replace, []

    def replace(self: Path, target: Path) -> Path:
        if self.suffix == ".parquet" and len(moved) == kept:
            raise SystemExit
        moved.extend([self] * (self.suffix == ".parquet"))
        return real(self, target)

    def stop(*_: object) -> None:
        raise SystemExit

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", replace)
        patched.setattr("closeform.storage.publishing.remove_folders", lambda folders: None)
        patched.setattr("closeform.storage.publishing.drop", stop)  # as a process that is gone
        with pytest.raises(SystemExit):
            main(STUDY)
    again = flown_ranges(monkeypatch)
    assert main(STUDY) == 1
    assert again == []
    assert rows(desk / "out") == rows(undisturbed)
    assert main([*STUDY, "--seed", "8", "--overwrite"]) == 1
    assert not (desk / "out" / ".unfinished").exists()


# statistics


@pytest.mark.parametrize("text", [NARROW, GATHERING])
def test_statistics_of_files_and_arrays_agree(text, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(search_cases, "PAIRS_AT_ONCE", 100)
    monkeypatch.setattr("closeform.campaign.search_cases.GATHERINGS_AT_ONCE", 70)
    scenario = parse(text)
    held, kind = evaluated(scenario, 300, 5), kind_of(scenario, 5)
    stored = Stored(kind, 300, tmp_path / "cases", tmp_path / "manifest.jsonl")
    stored.begin()
    for some in stored.missing:
        stored.take(Chunk.of(kind, *some))
    found = kind.campaign(stored)
    np.testing.assert_array_equal(found.time, held.time)
    np.testing.assert_array_equal(found.leg, held.leg)
    np.testing.assert_array_equal(found.good, held.good)
    assert (found.reason, found.spreads) == (held.reason, held.spreads)
    time = held.time[held.leg >= 0]
    told = held.spreads["time [s]"]
    assert told.mean == pytest.approx(time.mean())
    for share, one in told.quantiles.items():
        assert one.value == pytest.approx(np.quantile(time, share), rel=1e-12)
    assert told.worst[0] == (time.max(), int(np.nanargmax(held.time)))
    assert [value for value, _ in told.worst] == sorted(time)[:-11:-1]
    assert held.tally.good.count == held.good.sum()


def test_order_statistics_are_exact(monkeypatch) -> None:
    """Only a few values are held in memory, and many are equal."""
    monkeypatch.setattr(spread, "HELD", 40)
    rng = np.random.default_rng(2)
    values = np.round(np.exp(rng.normal(2.0, 3.0, 5000)), 2)
    values[rng.random(5000) < 0.4] = 0.0
    parts = [(values[k : k + 700], np.arange(k, min(k + 700, 5000))) for k in range(0, 5000, 700)]
    ranks = {0, 1, 1999, 2000, 2500, 4749, 4994, 4999}
    order = np.sort(values)
    assert order_statistics(lambda: parts, len(order), ranks) == {rank: order[rank] for rank in ranks}


def test_quantile_intervals_have_their_confidence() -> None:
    """In 150 samples of 2000, intervals contain the true quantile at least as often as stated (95 %)."""
    rng, truth = np.random.default_rng(3), stats.expon()
    for share in (0.5, 0.95):
        held = 0
        for _ in range(150):
            values = rng.exponential(size=2000)
            one = Spread.of(lambda values=values: [(values, np.arange(2000))])
            assert one is not None
            quantile = one.quantiles[share]
            assert quantile.low <= quantile.value <= quantile.high
            held += quantile.low <= truth.ppf(share) <= quantile.high
        assert stats.binom.cdf(held, 150, 0.95) > 1e-3
        assert stats.binom.sf(held, 150, 0.975) > 1e-3  # and is as narrow as whole ranks allow
    few = Spread.of(lambda: [(np.arange(5.0), np.arange(5))])
    assert few is not None
    assert few.quantiles[0.999].high is None  # not determined by five values


def test_histogram_of_chunks_is_that_of_all_times() -> None:
    campaign = evaluated(load(S04), 20_000)
    times, search = campaign.time, campaign.search
    parts = TimeHistogram.of(np.array_split(times, 7), search.duration, search)
    later = times[times > 0.0]
    edges = 60.0 * np.arange(len(parts.counts) + 1)
    np.testing.assert_array_equal(parts.counts, np.histogram(later, edges)[0])
    np.testing.assert_array_equal(parts.finer.reshape(-1, 12).sum(axis=1), parts.counts)
    inside = [np.count_nonzero((later > start) & (later <= end)) for *_, start, end in search.phases]
    np.testing.assert_array_equal(parts.inside, inside)
    assert (parts.every, parts.at_once, parts.last) == (20_000, (times == 0.0).sum(), times.max())


def test_memory_does_not_grow_with_cases(tmp_path, monkeypatch) -> None:
    """Statistics of four times as many chunks need no more memory."""
    monkeypatch.setattr(search_cases, "PAIRS_AT_ONCE", 5_000)
    monkeypatch.setattr(spread, "HELD", 500)
    kind, peaks = kind_of(parse(NARROW.replace("cases = 300", "cases = 100")), 7), []
    for count in (10_000, 40_000):
        stored = Stored(kind, count, tmp_path / f"{count}", tmp_path / f"{count}.jsonl")
        stored.begin()
        for some in stored.missing:
            stored.take(Chunk.of(kind, *some))
        tracemalloc.start()
        campaign = kind.campaign(stored)
        assert 0 < campaign.tally.good.count < count
        assert len(campaign.spreads) == 2
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    small, large = peaks
    assert large < 1.7 * small


# remote workers


def test_remote_task_gives_the_same_bytes() -> None:
    kind = kind_of(parse(NARROW), 7)
    sent = pickle.dumps(kind)
    for some in ((50, 100), (0, 50)):
        here = Chunk.of(kind, *some)
        assert evaluate(sent, versions(), some) == here._replace(data=here.data.to_pybytes())
    with pytest.raises(ClusterError, match="install the same versions on all machines"):
        evaluate(sent, {"numpy": "0.1"}, (0, 50))


def test_worker_reports_the_same_error() -> None:
    text = NARROW.replace('{ shell = ["50 m", "200 m"] }', '{ choice = ["1 2 3 m"] }')
    kind = kind_of(parse(text, "one.toml"), 7)
    with pytest.raises(ScenarioError) as here:
        kind.columns(0, 10)
    with pytest.raises(ScenarioError) as there:
        evaluate(pickle.dumps(kind), versions(), (0, 10))
    assert pickle.loads(pickle.dumps(there.value)).lines == here.value.lines


def test_remote_task_includes_named_files(tmp_path) -> None:
    """A file of states is sent along."""
    (tmp_path / "states.csv").write_text(
        "craft,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\nP,0,0,0,0,0,0\nQ,1,2,3,0,0,0\nR,10,0,0,0,0,0\n"
    )
    text = NARROW.replace(
        'position = ["0 0 0 m", "0 0 0 m", "10 0 0 m"]\nvelocity = "0 0 0 m/s"\n',
        'states = "states.csv"\n',
    )
    (tmp_path / "named.toml").write_text(text)
    kind = kind_of(load(tmp_path / "named.toml"), 7)
    sent = pickle.dumps(kind)
    (tmp_path / "states.csv").unlink()
    assert evaluate(sent, versions(), (0, 20)).digest == Chunk.of(kind, 0, 20).digest


def test_chunks_meet_without_a_gap() -> None:
    stored = Stored(kind_of(load(EXAMPLES / "h03.toml"), 1), 20_001, Path("none"), Path("none.jsonl"))
    ranges = [*stored.missing]
    assert all(one[1] == other[0] for one, other in pairwise(ranges))
    assert (ranges[0][0], ranges[-1][1]) == (0, 20_001)
    assert case_of(load(S04), 3).case == 3
    assert chunks.name_of(3) == "000000003.parquet"


def test_ten_largest_cases_link_to_their_replays(desk, capsys) -> None:
    main(STUDY)
    summary = json.loads((desk / "out" / "summary.json").read_text())
    page = (desk / "out" / "report.html").read_text().partition("The ten largest")[2].partition("</table>")[0]
    worst = summary["spreads"]["time [s]"]["worst"]
    assert len(worst) == 10
    for value, case in worst:
        assert f"{value:.4f}" in page
        assert f"closeform run narrow.toml --case {case}" in page
    assert f'href="case-{worst[0][1]}.html"' in page
