"""Studies of searches: samples, statistics, examples against the papers, result folders and messages."""

import json
import re
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy import stats

from closeform.campaign import (
    Campaign,
    CampaignStatus,
    GatherCampaign,
    LockCampaign,
    case_of,
    drawn,
    evaluated,
    study,
)
from closeform.campaign.draws import searching, uniform
from closeform.cli.app import main
from closeform.cli.console import WIDTH
from closeform.cli.study import report_of
from closeform.confidence import estimate
from closeform.mission.mission import plan_mission
from closeform.report.run import RunReport
from closeform.report.study import by_detection, command
from closeform.scenario import Scenario, ScenarioError, load, parse
from closeform.search.gathering.gather import gather
from closeform.search.gathering.result import Gathering
from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from pages import assert_linked
from runs import numbers
from studies import EXAMPLES, GATHERING, H03, LOST, NARROW, S04, as_words

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def s04(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder and the output of the example with its 150 000 cases."""
    place = tmp_path_factory.mktemp("s04") / "results"
    printed = StringIO()
    with redirect_stdout(printed):
        assert main(["study", str(S04), "--out", str(place)]) == 0
    return place, printed.getvalue()


def without_samples(scenario: Scenario) -> Scenario:
    assert scenario.study is not None
    return replace(scenario, study=scenario.study.model_copy(update={"sampled": ()}))


# samples


def philox(counter: int, key: tuple[int, int]) -> list[int]:
    """One block of Philox4x64-10, from its publication (Salmon et al. 2011, section 3.3)."""
    mask = 2**64 - 1
    words = [counter >> (64 * k) & mask for k in range(4)]
    for turn in range(10):
        keys = [(key[0] + turn * 0x9E3779B97F4A7C15) & mask, (key[1] + turn * 0xBB67AE8584CAA73B) & mask]
        one, other = 0xD2E7470EE14C6C93 * words[0], 0xCA5A826395121157 * words[2]
        words = [other >> 64 ^ words[1] ^ keys[0], other & mask, one >> 64 ^ words[3] ^ keys[1], one & mask]
    return words


def test_random_numbers_are_the_blocks_of_philox() -> None:
    """Spacecraft c of 3 in case K has the block after counter 3 K + c, in any range of cases."""
    key = np.random.SeedSequence(11, spawn_key=tuple(b"craft.position")).generate_state(2, np.uint64).tolist()
    found = uniform(11, "craft.position", 3, 40, 42)
    for case in (0, 1):
        for craft in range(3):
            words = philox(3 * (40 + case) + craft + 1, tuple(key))
            expected = [((word >> 11) + 0.5) / 2**53 for word in words]
            np.testing.assert_array_equal(found[case, craft], expected)


def test_samples_of_a_case_do_not_depend_on_the_range() -> None:
    scenario = parse(NARROW)
    whole = drawn(scenario, 7, 0, 60)
    for first, last in ((0, 1), (17, 18), (23, 51), (59, 60)):
        np.testing.assert_array_equal(drawn(scenario, 7, first, last), whole[first:last])
    assert not np.isin(drawn(scenario, 8, 0, 60)[..., :2], whole[..., :2]).any()
    assert len(np.unique(whole)) == whole.size  # all cases, spacecraft and components differ


def test_samples_do_not_depend_on_other_keys() -> None:
    lines = NARROW.splitlines(keepends=True)
    swapped = parse("".join([*lines[:-2], lines[-1], lines[-2]]))
    np.testing.assert_array_equal(drawn(swapped, 7, 0, 9), drawn(parse(NARROW), 7, 0, 9))
    alone = parse("".join([*lines[:-2], lines[-1]]))
    np.testing.assert_array_equal(drawn(alone, 7, 0, 9)[..., :3], drawn(parse(NARROW), 7, 0, 9)[..., :3])


@pytest.mark.parametrize(
    ("draw", "radius"),
    [
        ('{ ball = "120 m" }', lambda r: (r / 120.0) ** 3),
        ('{ shell = ["60 m", "120 m"] }', lambda r: (r**3 - 60.0**3) / (120.0**3 - 60.0**3)),
        ('{ normal = "40 m" }', lambda r: stats.chi(3, scale=40.0).cdf(r)),
    ],
)
def test_ball_shell_and_normal_distributions(draw: str, radius) -> None:
    """The distance from the nominal position has its distribution; directions are uniform."""
    scenario = parse(NARROW.replace('{ shell = ["50 m", "200 m"] }', draw))
    moved = drawn(scenario, 3, 0, 4000)[..., :3] - np.array([[0, 0, 0], [0, 0, 0], [10, 0, 0]])
    far = np.linalg.norm(moved, axis=-1)
    assert stats.kstest(radius(far).ravel(), "uniform").pvalue > 1e-3
    for axis in range(3):  # Archimedes: each component of a direction is uniform in [-1, 1]
        assert stats.kstest((moved[..., axis] / far).ravel(), "uniform", (-1.0, 2.0)).pvalue > 1e-3
    assert abs(np.corrcoef(moved.reshape(4000, 9).T) - np.eye(9)).max() < 0.06  # 4 sigma


def test_shell_of_equal_radii_has_an_exact_size() -> None:
    scenario = parse(NARROW.replace('["50 m", "200 m"]', '["70 m", "70 m"]'))
    moved = drawn(scenario, 3, 0, 1000)[..., :3] - np.array([[0, 0, 0], [0, 0, 0], [10, 0, 0]])
    np.testing.assert_allclose(np.linalg.norm(moved, axis=-1), 70.0, rtol=1e-14)
    assert abs(moved.mean(axis=(0, 1))).max() < 4.0 * 70.0 / np.sqrt(3.0 * 3000.0)


def test_uniform_and_choice_distributions() -> None:
    text = NARROW.replace('{ normal = "5 cm/s" }', '{ choice = ["1 0 0 m/s", "0 2 0 m/s", "0 0 3 m/s"] }')
    states = drawn(parse(text.replace('{ shell = ["50 m", "200 m"] }', '{ uniform = "80 m" }')), 5, 0, 3000)
    moved = states[..., :3] - np.array([[0, 0, 0], [0, 0, 0], [10, 0, 0]])
    for craft in range(3):
        for axis in range(3):
            assert stats.kstest(moved[:, craft, axis], "uniform", (-80.0, 160.0)).pvalue > 1e-3
    values, counts = np.unique(states[..., 3:].reshape(-1, 3), axis=0, return_counts=True)
    np.testing.assert_array_equal(values, [[0, 0, 3], [0, 2, 0], [1, 0, 0]])
    assert stats.chisquare(counts).pvalue > 1e-3


def test_case_of_equals_the_case_of_the_study() -> None:
    scenario = parse(NARROW)
    one = case_of(scenario, 41)
    np.testing.assert_array_equal(
        [craft.state(one.orbit.build()) for craft in one.craft], drawn(scenario, 7, 41, 42)[0]
    )
    assert (one.title, one.digest) == ("Narrow: case 41", scenario.digest)


# statistics


@pytest.mark.parametrize(("count", "total"), [(0, 10), (10, 10), (3, 10), (37, 150_000), (0, 150_000)])
def test_confidence_intervals_are_wilsons(count: int, total: int) -> None:
    theirs = stats.binomtest(count, total).proportion_ci(0.95, "wilson")
    ours = estimate(count, total)
    assert (ours.share, ours.low, ours.high) == pytest.approx(
        (count / total, theirs.low, theirs.high), rel=1e-9
    )


def test_phase_shares_agree_with_lock_times(s04: tuple[Path, str]) -> None:
    """Shares follow from lock times and the papers' ends of phases: 2160.0, 4283.0, 6443.0, 8566.0 s."""
    rows = pyarrow.parquet.read_table(s04[0] / "cases").to_pydict()
    time = np.array(rows["time_s"])
    assert rows["case"] == list(range(150_000))
    ends = [540 / 0.25, 4283.015, 4283.015 + 2160.0, 8566.03]
    counts = [(time == 0.0).sum(), *np.histogram(time[time > 0.0], [0.0, *ends])[0], np.isnan(time).sum()]
    shares = json.loads((s04[0] / "summary.json").read_text())["shares"]
    assert [share["cases"] for share in shares] == counts
    assert [share["phase"] for share in shares] == ["at once", "IPS 1", "mOPS 1", "IPS 2", "mOPS 2", "never"]
    assert [share["by_end"]["share"] for share in shares[:-1]] == list(np.cumsum(counts[:-1]) / 150_000)
    phase = np.array(["IPS", "mOPS", "IPS", "mOPS"])[np.searchsorted(ends, time)]
    assert rows["phase"] == phase.tolist()
    assert rows["round"] == np.where(time > 4283.015, 2, 1).tolist()


# S04


def test_fractions_of_s04() -> None:
    """1 500 000 cases of exact detection against the paper's 150 000, by the error of both samples."""
    campaign = evaluated(without_samples(load(S04)), 1_500_000)
    share = {one.label: one for one in campaign.shares}
    theirs = 150_000  # cases
    for published, ours in (
        (0.3337, share["at once"].inside.share),
        (0.9733, share["IPS 1"].by_end.share),
        (0.0265, share["mOPS 1"].inside.share),
    ):
        sigma = np.sqrt(ours * (1 - ours) * (1 / theirs + 1 / len(campaign)))
        assert abs(published - ours) < 3 * sigma + 0.5e-4  # the paper rounds to 0.01 %
    assert share["never"].cases == 0  # S04 theorem 2
    expected = share["IPS 2"].inside.share * theirs
    assert 13 < expected < 20  # measured: 16.5 of 150 000 over 60 million cases
    assert stats.poisson.sf(36, expected) < 1e-3  # exact detection does not give the paper's 37


def test_s04s_count_in_the_second_ips_is_that_of_sampling(s04: tuple[Path, str]) -> None:
    """S04's 37 of 150 000 agree with samples every 20 s, not with exact detection or samples every 60 s."""
    scenario = load(S04)
    study = scenario.study.model_copy(update={"sampled": (1.0, 10.0, 20.0, 60.0)})
    campaign = evaluated(replace(scenario, study=study), 600_000)
    assert isinstance(campaign, LockCampaign)
    counts = {way: found["IPS 2"] / 4 for way, found in by_detection(campaign).items()}
    assert stats.poisson.sf(36, counts["exact"]) < 1e-3
    assert stats.poisson.sf(36, counts["every 1 s"]) < 1e-3
    assert 0.025 < stats.poisson.cdf(37, counts["every 20 s"]) < 0.975
    assert stats.poisson.cdf(37, counts["every 60 s"]) < 1e-3
    for one in campaign.sampled:
        assert np.isfinite(one.time).all()
        assert (campaign.time <= one.time).all()  # exact detection is never later


def test_report_of_s04(s04: tuple[Path, str]) -> None:
    results, printed = s04
    lines = printed.splitlines()
    assert max(map(len, lines)) <= WIDTH
    for row, theirs in (("at once", "33.37 %"), ("IPS 1", "97.33 % by its end"), ("mOPS 1", "2.65 %")):
        assert re.search(rf"^{row} .* {re.escape(theirs)}\s*$", printed, re.MULTILINE)
    assert re.search(r"^IPS 2 .* 37 cases\s*$", printed, re.MULTILINE)
    assert lines[-1] == f"all 150000 cases locked; results in {results}"
    page = (results / "report.html").read_text()
    assert "97.33 % by its end" in page
    assert_linked(results)
    assert re.findall(r'href="(case-\d+\.html)"', page)  # replays of cases
    assert (results / "scenario.toml").read_text() == S04.read_text()
    assert {file.name for file in (results / "cases").iterdir()} == {"000000000.parquet", "000100000.parquet"}


def test_summary_holds_every_printed_figure(s04: tuple[Path, str]) -> None:
    summary = json.loads((s04[0] / "summary.json").read_text())
    assert (summary["status"], summary["seed"], summary["cases"]) == (0, 2004, 150_000)
    assert summary["inputs"] == {"s04.toml": f"sha256:{load(S04).digest}"}
    kept = numbers(summary)
    kept += [100.0 * value for value in kept] + [np.degrees(value) for value in kept]
    body = re.sub(r"[\d.]+ % by its end|[\d.]+ %", "", s04[1].split("\n", 1)[1])
    figures = re.findall(r"(?<![\w.])\d+\.\d+", body)
    assert len(figures) > 30
    for text in figures:
        step = 10.0 ** -len(text.split(".")[1])
        assert any(abs(value - float(text)) <= 0.51 * step for value in kept), (
            f"{text} is not in summary.json"
        )


def test_sampled_detection_agrees_with_angles() -> None:
    """Each sensor is in the other's cone: angles by NumPy, every 50 s."""
    for search in (
        Search.modified(Sensor(np.radians(70)), np.radians(0.25), np.radians(25)),
        Search.basic(Sensor(np.radians(40), offset=7.5, range=300.0), np.radians(0.25), np.radians(25)),
    ):
        generator = np.random.default_rng(1)
        position = generator.uniform(-250, 250, (300, 3))
        velocity = generator.uniform(-0.2, 0.2, (300, 3))
        samples = np.arange(0.0, search.duration, 50.0)
        boresight = search.boresight(samples)
        where = position[:, None] + velocity[:, None] * samples[:, None]
        line = where - 2.0 * search.sensor.offset * boresight  # from A's sensor to B's
        far = np.linalg.norm(line, axis=-1)
        angle = np.arccos(np.clip((line * boresight).sum(-1) / far, -1.0, 1.0))
        seen = (angle <= search.sensor.half_angle) & (far <= search.sensor.range)
        expected = np.where(seen.any(axis=1), samples[seen.argmax(axis=1)], np.nan)
        found = lock_times(search, position, velocity, step=50.0)
        times, legs = found.time, found.leg
        np.testing.assert_array_equal(times, expected)
        assert ((legs >= 0) == seen.any(axis=1)).all()
        for time, leg in zip(times[legs >= 0], legs[legs >= 0], strict=True):
            assert search.legs[leg].start <= time <= search.legs[leg].end
        exact = lock_times(search, position, velocity)
        assert (exact.time[legs >= 0] <= times[legs >= 0]).all()


# several pairs, and failed cases


def test_lock_time_of_a_case_is_that_of_its_last_pair(tmp_path) -> None:
    (tmp_path / "narrow.toml").write_text(NARROW)
    campaign = study(tmp_path / "narrow.toml", cases=200)
    assert isinstance(campaign, LockCampaign)
    assert campaign.pairs.tolist() == [[0, 1], [2, 1]]  # A to B
    states = drawn(campaign.scenario, 7, 0, 200)
    for k, (one, other) in enumerate(campaign.pairs):
        moves = states[:, other] - states[:, one]
        alone = lock_times(campaign.search, moves[:, :3], moves[:, 3:])
        np.testing.assert_array_equal(campaign.pair_time[:, k], alone.time)
        np.testing.assert_array_equal(campaign.pair_leg[:, k], alone.leg)
    both = np.isfinite(campaign.pair_time).all(axis=1)
    np.testing.assert_array_equal(campaign.time[both], campaign.pair_time[both].max(axis=1))
    np.testing.assert_array_equal(campaign.leg[both], campaign.pair_leg[both].max(axis=1))
    assert np.isnan(campaign.time[~both]).all()
    assert campaign.failed.tolist() == np.flatnonzero(~both).tolist()
    assert 0 < len(campaign.failed) < 200
    assert sum(share.cases for share in campaign.shares) == 200  # failures stay in the denominator
    assert campaign.shares[-1].inside.share == len(campaign.failed) / 200


@pytest.mark.parametrize("file", ["narrow.toml", "two words.toml", "it's $HOME.toml"])
def test_printed_commands_are_valid_shell_words(file) -> None:
    """A shell reads any file name as one word, in all four places."""
    scenario = parse(NARROW, file)
    campaign = evaluated(scenario, 50)
    report, case = report_of(campaign, scenario), int(campaign.failed[0])
    run = ["closeform", "run", file, "--case", str(case)]
    study = ["closeform", "study", file, "--cases", "50"]
    (hint,) = report.hint
    assert as_words(hint)[:5] == run
    assert as_words(command(campaign, f"case {case}")) == run
    for one, told in ((RunReport(plan_mission(case_of(scenario, case))).repeat, run), (report.repeat, study)):
        assert as_words(one(None).section(()).tables[0].rows[0][1]) == told


def test_failed_cases_are_counted_listed_and_have_null_times(tmp_path, monkeypatch, capsys) -> None:
    """The printed command replays the first of them beside the study."""
    monkeypatch.chdir(tmp_path)
    file, place = Path("narrow.toml"), Path("out")
    file.write_text(NARROW)
    assert main(["study", str(file), "--out", str(place)]) == 1
    campaign = evaluated(load(file))
    printed = capsys.readouterr().out
    assert "ublished" not in printed  # figures of a paper, which this file does not have
    assert campaign.status is CampaignStatus.INCOMPLETE
    first = campaign.failed[0]
    assert f"closeform run {file} --case {first} shows the first of them" in printed.replace("\n", " ")
    assert f"{len(campaign.failed)} of 300 cases not locked: {first}, " in printed
    rows = pyarrow.parquet.read_table(place / "cases").to_pydict()
    assert len(rows["case"]) == 600
    assert [time is None for time in rows["time_s"]] == np.isnan(campaign.pair_time).ravel().tolist()
    assert [phase is None for phase in rows["phase"]] == [time is None for time in rows["time_s"]]
    assert rows["first"][:4] == ["P", "R", "P", "R"]
    assert rows["second"][:4] == ["Q"] * 4
    states = drawn(campaign.scenario, 7, 0, 300)
    assert rows["vy_m_s"][3] == states[1, 1, 4] - states[1, 2, 4]
    summary = json.loads((place / "summary.json").read_text())
    assert (summary["status"], summary["failed"]) == (1, len(campaign.failed))
    assert main(["run", str(file), "--case", str(first)]) == 1
    assert "never lock" in capsys.readouterr().out
    replayed = json.loads(Path(f"narrow-case-{first}-results/summary.json").read_text())
    assert (replayed["case"], replayed["seed"]) == (first, 7)


# gatherings


def test_study_of_gatherings_agrees_with_gather() -> None:
    scenario = parse(GATHERING)
    campaign = evaluated(scenario, 40)
    assert isinstance(campaign, GatherCampaign)
    for case, states in enumerate(drawn(scenario, 7, 0, 40)):
        one = gather(
            Search.basic(scenario.sensor.build(), np.radians(0.25), np.radians(25)),
            states[:, :3],
            states[:, 3:],
            ["A", "B", "A"],
            rounds=2,
        )
        assert campaign.rounds[case] == one.rounds
        assert campaign.delta_v[case] == pytest.approx(one.delta_v.sum(), rel=1e-12)
        assert (campaign.leg[case] >= 0) == one.ok
        assert campaign.left[case] == (0 if one.ok else 3 - len(one.sets[0]) if one.sets else 3)
        if one.ok:
            assert campaign.time[case] == one.duration
    assert 0 < len(campaign.failed) < 40


def test_delta_v_of_gatherings_by_cause_and_phase() -> None:
    """Sums of the events of each case's run, which test_gathering.py checks independently."""
    text = LOST.replace("[sensor]", 'keep_out = { sphere = "40 m" }\n\n[sensor]')
    campaign = evaluated(parse(text.replace("180 m", "300 m")), 60)
    assert isinstance(campaign, GatherCampaign)
    words = {
        "burn": "to join the formation set",
        "correction": "on corrections against collisions",
        "near field": "in the near-field search",
    }
    spent: dict[str, list[float]] = {name: [] for name in words.values()}
    for case in range(60):
        one = plan_mission(case_of(campaign.scenario, case)).results[0].result
        assert isinstance(one, Gathering)
        if not one.ok:
            continue
        each = {
            kind: sum(np.linalg.norm(event.delta_v) for event in one.events if event.kind == kind)
            for kind in words
        }
        last = one.events[-1]
        until = "gathered at once" if one.duration == 0.0 else f"gathered in {last.phase} {last.round}"
        for name, size in [
            *((words[kind], size) for kind, size in each.items()),
            (until, sum(each.values())),
        ]:
            spent.setdefault(name, []).append(float(size))
    assert campaign.costs.keys() == spent.keys()
    assert len(spent) > 5
    for name, sizes in spent.items():
        found = campaign.costs[name]
        assert found.count == len(sizes)
        assert max(sizes) > 0.0
        told = [found.mean, found.quantiles[0.5].value, found.quantiles[0.95].value, found.worst[0][0]]
        truth = [np.mean(sizes), *np.quantile(sizes, [0.5, 0.95]), np.max(sizes)]
        np.testing.assert_allclose(told, truth, rtol=1e-12, atol=1e-15)


def test_h03() -> None:
    """Five spacecraft; the paper says "typically completed during IPS" and "no failures"."""
    campaign = study(H03)
    assert isinstance(campaign, GatherCampaign)
    assert len(campaign) == 100_000
    assert len(campaign.failed) == 0
    # spacecraft that do not know each other pass within 20 m in some cases, which is a conflict
    assert campaign.status is CampaignStatus.UNMET
    np.testing.assert_array_equal(campaign.good, campaign.met_unknown + campaign.met_known == 0)
    share = {one.label: one for one in campaign.shares}
    assert share["IPS 1"].by_end.low > 0.9
    assert share["never"].inside.high < 1e-4
    assert campaign.search.phases[0][3] == pytest.approx(24 * 60.0)  # s: the paper's IPS of one turn
    states = drawn(campaign.scenario, campaign.seed, 0, 1000)
    gaps = states[:, :, None] - states[:, None]
    assert np.linalg.norm(gaps[..., :3], axis=-1).max() < 300.0  # m
    assert np.linalg.norm(gaps[..., 3:], axis=-1).max() < 0.12  # m/s


def test_results_folder_of_a_gathering_study(tmp_path, capsys) -> None:
    place = tmp_path / "out"
    (tmp_path / "narrow.toml").write_text(GATHERING)
    assert main(["study", str(tmp_path / "narrow.toml"), "--cases", "60", "--out", str(place)]) == 1
    printed, progress = capsys.readouterr()
    assert progress == ""  # without a terminal
    rows = pyarrow.parquet.read_table(place / "cases").to_pydict()
    campaign = evaluated(parse(GATHERING), 60)
    assert rows["case"] == list(range(60))
    assert [k for k, time in enumerate(rows["duration_s"]) if time is None] == campaign.failed.tolist()
    assert rows["left"] == campaign.left.tolist()
    assert rows["delta_v_m_s"] == campaign.delta_v.tolist()
    assert "delta-v of all craft [m/s]" in printed
    assert f"{len(campaign.failed)} of 60 cases not gathered: " in printed


# the command


def refused(capsys: pytest.CaptureFixture[str], command: list[str]) -> list[str]:
    """Return the error lines of a command that is refused."""
    assert main(command) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err.splitlines()


def test_error_messages_of_study_commands(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s04.toml").write_text(S04.read_text())
    Path("robust.toml").write_text((EXAMPLES / "robustness.toml").read_text())
    Path("cluster.toml").write_text((EXAMPLES / "cluster.toml").read_text())
    Path("one.toml").write_text(NARROW.replace('{ shell = ["50 m", "200 m"] }', '{ choice = ["1 2 3 m"] }'))
    together = (
        "s04.toml: craft.position: A1 and B1 are at the same position; add --case K, or use closeform study"
    )
    assert refused(capsys, ["run", "s04.toml"]) == [together]
    assert refused(capsys, ["run", "robust.toml"]) == [together.replace("s04", "robust")]
    assert refused(capsys, ["study", "cluster.toml"]) == [
        "cluster.toml: study: missing; add [study] with cases = 1000 and seed = 1"
    ]
    assert refused(capsys, ["run", "cluster.toml", "--case", "1"]) == [
        "--case: cluster.toml has no cases; add a [study] table, or leave the case out"
    ]
    assert refused(capsys, ["run", "s04.toml", "--case", "-1"]) == [
        "--case: -1 is negative, cases count from 0; give 0 or more"
    ]
    assert refused(capsys, ["study", "s04.toml", "--cases", "0"]) == [
        "--cases: expected a whole number of at least 1, got 0"
    ]
    assert refused(capsys, ["study", "s04.toml", "--seed", "-1"]) == [
        "--seed: expected a whole number of at least 0, got -1"
    ]
    assert refused(capsys, ["study", "s04.toml", "--scheduler", "tcp://127.0.0.1:1"]) == [
        "--scheduler: tcp://127.0.0.1:1 does not respond within 5 s; start it, or check the address"
    ]
    assert refused(capsys, ["study", "one.toml"]) == [
        "one.toml: study.vary: P and Q start at the same position in case 0; vary their positions"
    ]
    assert {file.name for file in Path().iterdir()} == {"s04.toml", "robust.toml", "cluster.toml", "one.toml"}
    assert main(["check", "s04.toml"]) == 0  # valid for a study and for a run of one case
    assert capsys.readouterr().out == (
        f"s04.toml: valid: 2 craft; stages: lock\n{together.replace('s04.toml:', 's04.toml: for run:')}\n"
    )


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        (
            'half_angle = "20 deg"',
            'half_angle = "60 deg"',
            "search.sun_limit: a half-angle of 60 deg requires tips of 35.264 deg, "
            "above the limit of 25 deg; "
            "a half-angle of 67.0902 deg is sufficient",
        ),
        (
            'half_angle = "20 deg"',
            'half_angle = "40 deg"',
            "sensor.half_angle: 40 deg is below 45 deg; no tip covers the complementary cones; ",
        ),
        ("deep_space = true", 'altitude = "500 km"', "orbit: a search is for deep space only; "),
        ("[study.vary]", '[study.published]\n"IPS" = "5 %"\n[study.vary]', 'study: published has "IPS", '),
        (
            '"craft.position" = { shell = ["50 m", "200 m"] }',
            "",
            "craft.position: P and Q are at the same position; move one of them",
        ),
        ('"A", "B", "A"', '"A", "A", "A"', "craft.group: group B is empty, "),
        ('["60 s"]', '["1 ms"]', 'study.sampled[1]: "1 ms" is below 0.01 s; '),
        ("[study.vary]", '[study.published]\nnever = "%s"\n[study.vary]' % ("5" * 21), "study: published "),
    ],
)
def test_invalid_search_studies_are_rejected(old: str, new: str, line: str) -> None:
    text = NARROW
    if "half_angle" in old:
        text = text.replace('method = "basic"', 'method = "modified"')
    assert old in text
    with pytest.raises(ScenarioError) as refused:
        parse(text.replace(old, new), "narrow.toml")
    assert len(refused.value.lines) == 1
    assert refused.value.lines[0].startswith(f"narrow.toml: {line}")
    assert "; " in refused.value.lines[0]


@pytest.mark.parametrize("cases", [0, 10**9, 1.5, True])
def test_invalid_number_of_cases_is_named(cases: object) -> None:
    with pytest.raises(ValueError, match=r"^cases: "):
        study(S04, cases)


def test_study_function_equals_the_command(s04: tuple[Path, str]) -> None:
    campaign: Campaign = study(str(S04), 1000)
    rows = pyarrow.parquet.read_table(s04[0] / "cases").slice(0, 1000).to_pydict()
    np.testing.assert_array_equal(campaign.time, rows["time_s"])
    assert (len(campaign), campaign.seed, campaign.ok, campaign.reason) == (1000, 2004, True, None)
    assert campaign.status == "complete"
    assert study(S04, 1000, seed=5).time.tolist() != campaign.time.tolist()


def test_run_evaluates_one_case(tmp_path, capsys) -> None:
    assert main(["run", str(S04), "--case", "3", "--out", str(tmp_path / "out")]) == 0
    time = study(S04, 4).time[3]
    assert f"{time:.2f}" in capsys.readouterr().out


# searches with errors


def test_cases_of_imperfect_searches_equal_their_runs() -> None:
    """The file has every key of search errors; some cases never lock."""
    campaign = study(EXAMPLES / "robustness.toml", 4000)
    scenario = load(EXAMPLES / "robustness.toml")
    assert 0.01 < len(campaign.failed) / 4000 < 0.2
    for case in [*range(6), *campaign.failed[:3].tolist()]:
        flown_alone = plan_mission(case_of(scenario, case)).results[0].result.locks
        np.testing.assert_array_equal(flown_alone.time, campaign.pair_time[case])
        np.testing.assert_array_equal(flown_alone.leg, campaign.pair_leg[case])


def test_cases_of_imperfect_gatherings_equal_their_runs() -> None:
    """Every key of search errors is sampled, and some are given."""
    given = 'slew_acceleration = ["0.01 deg/s^2", "0.02 deg/s^2", "0.03 deg/s^2"]\n[sensor]'
    text = GATHERING.replace("[sensor]", given) + (
        '"craft.pointing_error" = { ball = "5 deg" }\n"craft.slew_rate_error" = { normal = "2 %" }\n'
        '"craft.start_offset" = { normal = "60 s" }\n"craft.silent" = { chance = 0.05 }\n'
        '"craft.slew_acceleration" = { uniform = "0.005 deg/s^2" }\n'
        '"sensor.half_angle" = { uniform = "2 deg" }\n"sensor.range" = { choice = ["1 km", "2 km"] }\n'
        '"search.slew_rate" = { normal = "0.001 deg/s" }\n'
    )
    scenario = parse(text)
    campaign, perfect = evaluated(scenario, 60), evaluated(parse(GATHERING), 60)
    assert isinstance(campaign, GatherCampaign)
    for case in range(12):
        one = plan_mission(case_of(scenario, case)).results[0].result
        assert campaign.left[case] == (0 if one.ok else 3 - len(one.sets[0]) if one.sets else 3)
        assert campaign.delta_v[case] == pytest.approx(one.delta_v.sum(), rel=1e-12)
        if one.ok:
            assert campaign.time[case] == one.duration
    assert (campaign.time != perfect.time).mean() > 0.9


def test_search_errors_have_their_distributions() -> None:
    """Kolmogorov-Smirnov tests at a level of 1e-6, both groups together."""
    text = (EXAMPLES / "robustness.toml").read_text()
    text += '"sensor.half_angle" = { uniform = "2 deg" }\n"search.slew_rate" = { normal = "0.001 deg/s" }\n'
    text += '"craft.slew_acceleration" = { choice = ["0.01 deg/s^2", "0.02 deg/s^2"] }\n'
    scenario, count = parse(text), 20_000
    errors = searching(scenario, 3, 0, count)
    assert errors.shape == (count, 2)
    size = np.linalg.norm(errors.pointing, axis=-1).ravel()
    kinds = {
        "pointing": ((size / np.radians(0.5)) ** 3, stats.uniform()),
        "along": (errors.pointing[..., 2].ravel() / np.maximum(size, 1e-300) * 0.5 + 0.5, stats.uniform()),
        "start": (errors.start.ravel(), stats.norm(0.0, 2.0)),
        "half-angle": (errors.half_angle.ravel(), stats.uniform(-np.radians(2), np.radians(4))),
        # (1 + 0.001 x) (1 + 0.004 y), both normal; 40 000 samples do not resolve the product term
        "slew rate": (errors.slew_rate.ravel(), stats.norm(0.0, np.hypot(0.001, 0.004))),
    }
    for values, truth in kinds.values():
        assert stats.kstest(values, truth.cdf).pvalue > 1e-6
    assert set(np.unique(errors.range)) == {1000.0, 2000.0}
    assert stats.binomtest(int(errors.silent.sum()), 2 * count, 0.01).pvalue > 1e-6
    assert set(np.unique(errors.slew_acceleration)) == {np.radians(0.01), np.radians(0.02)}
    assert stats.binomtest(int((errors.range == 1000.0).sum()), 2 * count, 0.5).pvalue > 1e-6


def test_search_errors_of_a_case_do_not_depend_on_the_range() -> None:
    scenario = load(EXAMPLES / "robustness.toml")
    whole, some = searching(scenario, 9, 0, 50), searching(scenario, 9, 17, 33)
    for name in ("pointing", "slew_rate", "start", "range", "silent"):
        np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[17:33])


def test_events_of_a_spacecraft_have_separate_random_streams() -> None:
    """Compare with NumPy's generator at the counter of each event."""
    key = np.random.SeedSequence(5, spawn_key=tuple(b"craft.execution")).generate_state(2, np.uint64)
    for event in (0, 3):
        words = np.random.Philox(key=key, counter=(event << 64) + 7 * 3).random_raw(12).reshape(1, 3, 4)
        truth = ((words >> np.uint64(11)) + 0.5) * 2.0**-53
        np.testing.assert_array_equal(uniform(5, "craft.execution", 3, 7, 8, event), truth)


def test_scenarios_without_search_errors_sample_none() -> None:
    assert searching(load(S04), 1, 0, 10) is None
    assert searching(parse(GATHERING), 1, 0, 10) is None
