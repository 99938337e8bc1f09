"""Search stages in missions: output and results against independent models."""

import re
import runpy
import tomllib
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import closeform as cf
import turns
from closeform.cli.app import main
from closeform.cli.console import WIDTH
from closeform.mission.mission import plan_mission
from closeform.report.run import RunReport
from closeform.scenario import load, parse
from closeform.storage.publishing import folder
from lost import BASIC, Sky, gathered
from runs import AFTER, FIRST, MOVING, PLACES, Run, numbers, run_text, searched

pytestmark = pytest.mark.usefixtures("unpainted")

EXAMPLES = Path(__file__).parents[1] / "examples"
TOOLS = EXAMPLES.parent / "tools"
RATE = np.radians(0.25)
DIGITS = 0.51  # of the last digit printed


@pytest.fixture(scope="module")
def fly_file(tmp_path_factory):
    """Run a scenario file from the command line, with a short animation or none."""

    def run(file: Path, monkeypatch, capsys, filmed: int = 0) -> Run:
        if not filmed:
            monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
        monkeypatch.setattr("closeform.report.sections.searches.FILMED", filmed)
        monkeypatch.setattr("closeform.report.sections.searches.FRAMES", 2)
        monkeypatch.setattr("closeform.report.sections.searches.MOMENTS", 2)
        folder = tmp_path_factory.mktemp("run") / "results"
        capsys.readouterr()
        status = main(["run", str(file), "--out", str(folder)])
        return Run(status, capsys.readouterr().out, folder)

    return run


def two_apart(stage: str) -> str:
    """Return a scenario in which L1 and L2 lock at once and L3, of the group of L1, is out of range."""
    text = searched(
        after=AFTER,
        position='["0 0 0 m", "100 0 0 m", "0 900 200 m"]',
        half_angle='"70 deg"\nrange = "500 m"',
    )
    return text.replace('do = "gather"\nrounds = 2', stage)


def states(file: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return positions [m] and velocities [m/s] as written in the file."""
    craft = tomllib.loads(file.read_text())["craft"]
    scale = {"m": 1.0, "mm/s": 1e-3, "cm/s": 1e-2}
    return tuple(
        np.array([[float(x) for x in text.split()[:3]] for text in craft[key]])
        * scale[craft[key][0].split()[3]]
        for key in ("position", "velocity")
    )


def test_tpf_reproduces_h03(fly_file, monkeypatch, capsys) -> None:
    """Lock times of H03 section V, to the minute, and by an independent model."""
    file = EXAMPLES / "tpf.toml"
    run = fly_file(file, monkeypatch, capsys, filmed=5)
    assert run.status == 0
    locks = [event for event in run.table("events") if event["kind"] == "lock"]
    assert [round(event["time_s"]) for event in locks] == [720, 840, 960, 1720]
    assert [event["phase"] for event in locks] == ["IPS", "IPS", "IPS", "OPS"]
    assert [event["label"] for event in locks] == [0, 1, 1, 0]
    check_model(file, run)
    check_delta_v(file, run)
    check_print(run)
    names = {path.name for path in run.folder.iterdir()}
    assert {"stage-1-gathering.gif", "stage-1-view-1.png", "stage-1-view-2.png", "sets.parquet"} <= names
    page = (run.folder / "report.html").read_text()
    assert page.count("data:image/gif;base64,") == 1
    assert page.count("data:image/png;base64,") == 2


def check_model(file: Path, run: Run) -> None:
    """Compare locks and burns with dense sampling."""
    places, speeds = states(file)
    distances = [np.linalg.norm(places[i] - places[j]) for i, j in combinations(range(5), 2)]
    relative = [np.linalg.norm(speeds[i] - speeds[j]) for i, j in combinations(range(5), 2)]
    assert max(distances) <= 300.0
    assert max(relative) <= 0.12
    told = tomllib.loads(file.read_text())

    class Sensor:
        half_angle, offset, range = np.radians(70.0), 7.5, np.inf

    once = [("sun", 2 * np.pi) if turn == ("sun", 3 * np.pi) else turn for turn in BASIC]
    sky = Sky(once, np.radians(25.0), RATE)
    model = gathered(
        sky, Sensor, places, speeds, told["craft"]["group"], run.summary["stages"][0]["gathering"]["burns"]
    )
    assert model.ok
    names = told["craft"]["name"]
    found = run.table("events")
    assert len(found) == len(model.events)
    for event, (time, kind, first, second, case, impulse) in zip(found, model.events, strict=True):
        assert event["time_s"] == pytest.approx(time, abs=1e-6)  # s, what locks promise
        assert (event["kind"], event["first"], event["case"]) == (kind, names[first], case)
        assert event["second"] == (names[second] if second >= 0 else None)
        if impulse is not None:
            burn = [event[key] for key in ("dvx_m_s", "dvy_m_s", "dvz_m_s")]
            np.testing.assert_allclose(burn, impulse, atol=1e-12)


def check_delta_v(file: Path, run: Run) -> None:
    """Compare printed delta-v with three tables, the jumps of the paths and the initial velocities."""
    places, speeds = states(file)
    figures = run.summary["stages"][0]["gathering"]
    spent = {row["craft"]: row["delta_v_m_s"] for row in run.table("sets")}
    for row in run.table("craft"):
        assert row["delta_v_m_s"] == pytest.approx(spent[row["craft"]], abs=1e-12)
    paths = run.table("paths")
    last = [row for row in paths if row["time_s"] == max(other["time_s"] for other in paths)]
    ends = np.array([[row[key] for key in ("vx_m_s", "vy_m_s", "vz_m_s")] for row in last])
    np.testing.assert_allclose(ends, ends[:1].repeat(5, axis=0), atol=1e-12)  # a common velocity
    first = {row["craft"]: row for row in paths[::-1]}
    for craft, end in zip(spent, ends, strict=True):  # each burns at most once
        jump = end - [first[craft][key] for key in ("vx_m_s", "vy_m_s", "vz_m_s")]
        assert np.linalg.norm(jump) == pytest.approx(spent[craft], abs=1e-12)
    for way, kept in (("second", speeds[0]), ("first", speeds[1]), ("half", speeds[:2].mean(axis=0))):
        total = np.linalg.norm(speeds - kept, axis=1).sum()
        assert figures["totals_m_s"][way] == pytest.approx(total, abs=1e-12)
        assert re.search(rf"^{way}: .* {1e3 * total:.1f}\b", run.printed, re.MULTILINE)
    assert figures["burns"] == min(figures["totals_m_s"], key=figures["totals_m_s"].get)


def check_print(run: Run) -> None:
    """Compare the timeline with the events; each printed number is in the summary or in a table."""
    assert max(map(len, run.printed.splitlines()[:-1])) <= WIDTH
    rows = re.findall(
        r"^ *(\d+\.\d\d) +(\d+):(\d\d)  (\w+ \d)  (\S+(?: - \S+)?)  +(.*?)$", run.printed, re.MULTILINE
    )
    events = run.table("events")
    assert len(rows) == len(events)
    for (time, minute, second, phase, who, what), event in zip(rows, events, strict=True):
        assert float(time) == pytest.approx(event["time_s"], abs=0.00501)
        assert 60 * int(minute) + int(second) == pytest.approx(event["time_s"], abs=DIGITS)
        assert phase == f"{event['phase']} {event['round']}"
        assert who == " - ".join(filter(None, (event["first"], event["second"])))
        assert what.startswith("lock, " if event["kind"] == "lock" else "burn, ")
        if event["kind"] == "burn":
            size = np.linalg.norm([event[key] for key in ("dvx_m_s", "dvy_m_s", "dvz_m_s")])
            assert float(what.split()[-1]) == pytest.approx(1e3 * size, abs=0.0501)
    kept = [value for row in events for value in row.values() if isinstance(value, float)]
    kept += [np.linalg.norm([row[key] for key in ("dvx_m_s", "dvy_m_s", "dvz_m_s")]) for row in events]
    kept += numbers(run.summary)
    legs = run.summary["stages"][0]["search"]["legs"]
    kept += [leg["end_s"] - leg["start_s"] for leg in legs]
    kept += [scale * value for value in kept for scale in (1e3, 100.0, 180 / np.pi)]
    kept += [value % 60.0 for value in kept]
    body = run.printed.split("\n", 2)[2]
    for text in re.findall(r"(?<![\w.:])\d+\.\d+", body):
        places = len(text.split(".")[1])
        assert any(abs(value - float(text)) <= DIGITS * 10.0**-places for value in kept), f"{text} is nowhere"


def test_s04_counterexample_locks_in_the_second_mops(fly_file, monkeypatch, capsys) -> None:
    """S04 section V: 6692.29 s; an independent model of the turns agrees."""
    run = fly_file(EXAMPLES / "s04_counterexample.toml", monkeypatch, capsys)
    assert run.status == 0
    (lock,) = run.table("locks")
    assert lock["time_s"] == pytest.approx(6692.29, abs=0.005)
    assert (lock["first"], lock["second"], lock["phase"], lock["round"]) == ("I", "J", "mOPS", 2)
    assert re.search(r"I - J +6692\.29 +111:32 +mOPS 2", run.printed)
    assert "\nclear: no craft is lost, no search for conflicts" in run.printed
    places, speeds = states(EXAMPLES / "s04_counterexample.toml")
    half = np.radians(70.0)
    turning = turns.Turning(turns.turns("modified", half), RATE)
    model = turns.first_lock(turning, places[1] - places[0], speeds[1] - speeds[0], half)
    assert lock["time_s"] == pytest.approx(model, abs=1e-6)
    assert run.summary["stages"][0]["end_s"] == pytest.approx(turning.ends[-1], abs=1e-9)


def test_incomplete_gathering_of_a_swarm(fly_file, monkeypatch, capsys) -> None:
    assert (EXAMPLES / "swarm.toml").read_text() == runpy.run_path(str(TOOLS / "swarm.py"))["text"]()
    run = fly_file(EXAMPLES / "swarm.toml", monkeypatch, capsys)
    assert run.status == 1
    assert len(run.printed.splitlines()) < 80
    figures = run.summary["stages"][0]["gathering"]
    assert figures["status"] == "incomplete"
    assert figures["rounds"] == 4
    locked = {
        event[key] for event in run.table("events") if event["kind"] == "lock" for key in ("first", "second")
    }
    names = [row["craft"] for row in run.table("sets")]
    assert figures["lost"] == [name for name in names if name not in locked]
    assert sorted(sum(figures["sets"], figures["lost"])) == sorted(names)
    *body, end = run.printed.splitlines()
    assert max(map(len, body)) <= WIDTH
    assert run.summary["verdict"] in " ".join(run.printed.split())
    assert end == f"results in {run.folder}"
    verdict = run.summary["verdict"].split("stopped in")[1]
    for name in names:
        assert (name in verdict) == (name not in figures["sets"][0])
    assert "in 4 rounds" in verdict
    assert "stopped in stage 1 (gather)" in run.summary["verdict"]
    # the rows of the summary by phase add up to the table of events
    progress = run.printed.split("Progress")[1].split("\n", 2)[2].split("\n\n")[0].splitlines()
    rows = [row.replace(" in ", " ").split()[-8:] for row in progress if row.strip()]
    columns = np.array([[float(word) for word in row] for row in rows])
    locks = sum(event["kind"] == "lock" for event in run.table("events"))
    assert columns[:, 1].sum() == locks
    assert columns[:, 2].sum() == len(run.table("events")) - locks
    assert columns[:, 3].sum() == pytest.approx(1e3 * figures["total_delta_v_m_s"], abs=0.06 * len(columns))
    assert columns[-1, 4] == len(figures["sets"][0])
    assert columns[-1, 5] == sum(map(len, figures["sets"][1:]))
    assert columns[-1, 6] == len(figures["sets"]) - 1
    assert columns[-1, 7] == len(figures["lost"])
    # a burn rule of lower cost was not chosen because it leaves more spacecraft
    cheapest = min(figures["totals_m_s"], key=figures["totals_m_s"].get)
    assert cheapest != figures["burns"]
    assert "leaves more craft" in run.printed
    text = (EXAMPLES / "swarm.toml").read_text().replace("rounds = 4", f'rounds = 4\nburns = "{cheapest}"')
    (flown,) = plan_mission(parse(text)).results
    assert len(flown.result.sets[0]) < len(figures["sets"][0])
    assert sum(flown.result.delta_v) == pytest.approx(figures["totals_m_s"][cheapest])


def test_gathering_starts_at_the_end_of_the_previous_stage() -> None:
    both = plan_mission(parse(searched(FIRST, AFTER, position=PLACES, velocity=MOVING)))
    late = plan_mission(
        parse(searched(position='["0 0 0 m", "-99.9 0.2 0.3 m", "-0.2 90.1 199.6 m"]', velocity=MOVING))
    )
    drift, gather, coast = both.results
    assert gather.start == drift.end == 10.0
    assert gather.result.duration > 0.0
    assert gather.result.duration == pytest.approx(late.results[0].result.duration, abs=1e-6)
    assert gather.end == coast.start == pytest.approx(10.0 + gather.result.duration, abs=1e-9)
    assert coast.end == coast.start + 100.0
    for one, other in ((drift, gather), (gather, coast)):  # 1e-9 m, rounding of some 100 m
        ends = one.after.paths.state(one.end), other.after.paths.state(other.start)
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
    speeds = coast.after.paths.velocity(coast.end)
    np.testing.assert_allclose(speeds, speeds[:1].repeat(3, axis=0), atol=1e-12)
    told = "\n".join(RunReport(both).sections[1].lines)
    assert "Times count from the start of the search, at 10.0 s" in told


MOVE = """
[[stage]]
do = "reconfigure"
within = "20 min"
to = [
  { position = "100 0 0 m", velocity = "1 2 0 cm/s" },
  { position = "190 80 40 m", velocity = "0 -3 2 cm/s" },
  { position = "0 90 260 m", velocity = "-2 0 1 cm/s" },
]
"""


def test_gather_after_a_fault() -> None:
    """The search begins at the states that the move and the coast have reached, in one pass, at 1 Hz."""
    text = searched(MOVE + FIRST).replace(
        'method = "modified"', 'method = "basic"\npasses = 1\nrelaxed = true'
    )
    with pytest.raises(ValueError, match="again = true in a gather after a fault"):
        plan_mission(parse(text))
    move, coast, gather = plan_mission(
        parse(text.replace('"gather"', '"gather"\nagain = true\nstep = "1 s"'))
    ).results
    assert move.failure is None
    begin = move.after.paths.state(move.end)
    begin = begin + np.pad(begin[:, 3:] * (coast.end - coast.start), ((0, 0), (0, 3)))  # a straight coast
    search = cf.Search.basic(
        cf.Sensor(np.radians(70), 7.5), *np.radians([0.25, 25.0]), passes=1, relaxed=True
    )
    told = gather.result.search
    ends = [leg.end for leg in search.legs]  # a turn back to the start follows
    assert [leg.end for leg in told.legs[: len(ends)]] == ends
    alone = cf.gather(search, begin[:, :3], begin[:, 3:], ["A", "B", "A"], keep_out=cf.Sphere(10.0), step=1.0)
    assert [(e.time, e.first, e.second) for e in gather.result.events] == [
        (e.time, e.first, e.second) for e in alone.events
    ]
    assert gather.result.ok
    assert all(event.time == round(event.time) for event in gather.result.events)


def test_shade_is_the_body_of_a_spacecraft() -> None:
    """Two shades of 15 m touch at 15 m between their centres, without a keep_out."""
    text = searched().replace('keep_out = { sphere = "10 m" }', 'shade = "15 m"')
    assert parse(text).zones.between(0, 1).extents == pytest.approx([15.0] * 3)
    other = text.replace('shade = "15 m"', 'shade = "15 m"\nhard_body = "2 m"')
    assert parse(other).zones.between(0, 1).extents == pytest.approx([4.0] * 3)


def test_gathering_of_mutually_visible_spacecraft_takes_no_time() -> None:
    text = searched(FIRST, AFTER, position='["0 0 0 m", "100 0 0 m", "20 15 0 m"]')
    mission = plan_mission(parse(text))
    assert mission.clear
    assert [(flown.start, flown.end) for flown in mission.results] == [
        (0.0, 10.0),
        (10.0, 10.0),
        (10.0, 110.0),
    ]
    assert RunReport(mission).sections[1].lines[1].startswith("Gathered after 0.00 s (0 min 0.0 s)")


def test_incomplete_gathering_stops_the_mission(tmp_path, monkeypatch, capsys) -> None:
    run = run_text(two_apart('do = "gather"'), tmp_path, monkeypatch, capsys)
    assert run.status == 1
    assert len(run.summary["stages"]) == 1
    assert run.summary["verdict"] == "stopped in stage 1 (gather): craft L3 locked with no craft in 2 rounds"
    assert run.summary["stages"][0]["gathering"]["lost"] == ["L3"]
    assert {row["craft"]: row["set"] for row in run.table("sets")} == {"L1": 0, "L2": 0, "L3": -1}
    assert "Lost: L3" in run.printed
    assert (run.folder / "report.html").exists()


def test_lock_stage_names_pairs_without_a_lock(tmp_path, monkeypatch, capsys) -> None:
    run = run_text(two_apart('do = "lock"'), tmp_path, monkeypatch, capsys)
    assert run.status == 1
    assert run.summary["verdict"] == "stopped in stage 1 (lock): 1 of 2 pairs never lock: L3 - L2"
    assert run.summary["stages"][0]["end_s"] == pytest.approx(8566.0, abs=0.05)  # S04: 2.379 h
    assert [row["time_s"] for row in run.table("locks")] == [0.0, None]
    assert re.search(r"L3 - L2 +never +- +-", run.printed)
    assert "1 of 2 pairs lock, the last at 0.00 s" in run.printed


def test_conflicts_with_unknown_spacecraft_are_counted(tmp_path, monkeypatch, capsys) -> None:
    """L1 and L3, both of group A, pass at 5 m before either has a lock.

    They close at 1 m/s along y from 50 m, so they are within 10 m for 2 sqrt(75) s about 50 s.
    """
    text = searched(
        position='["0 0 0 m", "-300 0 10 m", "5 -50 0 m"]',
        velocity='["0 0 0 m/s", "0 0 0 m/s", "0 1 0 m/s"]',
    )
    run = run_text(text, tmp_path, monkeypatch, capsys)
    assert run.status == 1
    (conflict,) = run.table("conflicts")[:1]
    assert (conflict["first"], conflict["second"]) == ("L1", "L3")
    assert conflict["ratio"] == pytest.approx(0.5, abs=1e-9)
    assert conflict["end_s"] - conflict["start_s"] == pytest.approx(2 * np.sqrt(75.0), abs=1e-6)
    assert run.summary["stages"][0]["gathering"]["conflicts_known"][0] is False
    assert "1 conflict, 1 between craft in different sets" in run.printed
    assert re.search(r"L1 - L3 .* no$", run.printed, re.MULTILINE)
    assert "1 conflict remains" in run.printed


def test_each_pair_has_its_own_zone() -> None:
    zones = '[{ sphere = "10 m" }, { sphere = "20 m" }, { sphere = "10 m" }]'
    scenario = parse(searched(keep_out=zones, velocity=MOVING))
    assert scenario.gathering(scenario.stages[0])["keep_out"] is scenario.zones  # also for the gathering
    (flown,) = plan_mission(scenario).results
    assert {
        (near.first, near.second): float(1 / near.zone.norm([1.0, 0.0, 0.0]))
        for near in flown.after.approaches
    } == {
        ("L1", "L2"): 20.0,
        ("L1", "L3"): 10.0,
        ("L2", "L3"): 20.0,
    }


def test_long_timeline_is_folded() -> None:
    mission = plan_mission(load(EXAMPLES / "swarm.toml"))
    tables = {table.title.split(",")[0]: table for table in RunReport(mission).sections[0].tables}
    assert tables["Timeline"].folded
    assert tables["Delta-v of each craft"].folded
    assert not tables["Progress at the end of each phase with events"].folded
    assert len(tables["Timeline"].rows) == len(mission.results[0].result.events)


def test_tpf_states_tool_accepts_its_states() -> None:
    """tools/tpf_states.py: the four locks are within a second of the times of H03."""
    tool = runpy.run_path(str(TOOLS / "tpf_states.py"))
    places, speeds = states(EXAMPLES / "tpf.toml")
    five = np.concatenate([places, speeds], axis=1)
    assert tool["score"](five) < 1.0
    assert tool["fits"](five[1:] - five[:1]).all()
    assert tool["score"](five[[0, 3, 2, 1, 4]]) == np.inf  # the same craft, but TPF4 is found first


def test_progress_messages(tmp_path) -> None:
    said: list[str] = []
    mission = plan_mission(parse(searched(position=PLACES, velocity=MOVING)), said.append)
    with folder(tmp_path / "results") as under_way:
        RunReport(mission).write(under_way, said.append)
    assert said[0] == "stage 1 of 1: gather"
    assert "writing tables" in said
    shown = [text.split(":")[0] for text in said if text.startswith("picture")]
    assert shown == [f"picture {k + 1} of {len(shown)}" for k in range(len(shown))]


def test_near_field_search_of_two_spacecraft(tmp_path, monkeypatch, capsys) -> None:
    """60 m apart on the sun line no cone meets the other; both burn 24 cm/s backwards (H03 III.C)."""
    text = searched(name='["L1", "L2"]', group='["A", "B"]', position='["0 0 0 m", "0 0 60 m"]')
    text = text.replace('method = "modified"', 'method = "basic"\nmax_speed = "12 cm/s"')
    run = run_text(text, tmp_path, monkeypatch, capsys)
    assert run.status == 0
    burns = [event for event in run.table("events") if event["kind"] == "near field"]
    assert [(event["first"], event["phase"]) for event in burns] == [("L1", "NFS"), ("L2", "NFS")]
    np.testing.assert_allclose([event["dvx_m_s"] for event in burns], [-0.24, 0.24], atol=1e-12)
    assert run.printed.count("near-field burn against its boresight") == 2
    near, wait = re.search(
        r"never covered by its cone +([\d.]+) m\n.*\(NFS\) +2 x ([\d.]+) s", run.printed
    ).groups()
    assert float(near) == pytest.approx(81.0, abs=0.5)  # H03: about 80 m
    assert float(wait) == pytest.approx(float(near) / 0.12, abs=0.5)
