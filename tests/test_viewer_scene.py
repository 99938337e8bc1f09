"""Scenes of the viewer against their schema, the closed form and independent measurements."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation, Slerp

import closeform as cf
from closeform.cli.app import main
from closeform.exchange.ccsds.oem import read_oem
from closeform.exchange.common_frame import common_frame
from closeform.mission.mission import plan_mission
from closeform.mission.mission_result import Mission
from closeform.scenario import parse
from closeform.viewer.fleet import record
from closeform.viewer.page import document
from closeform.viewer.scene import scene_of
from closeform.viewer.shown import Shown
from pages import Parts, Seen, fields, fits

EXAMPLES = Path(__file__).parents[1] / "examples"
FLOWN = (
    "cluster",
    "cubesats",
    "docking",
    "tpf",
    "passive_inspector",
    "s04_counterexample",
    "swap_deep_space",
    "three_sigmas",
)


@cache
def mission(name: str) -> Mission:
    return cf.run(EXAMPLES / f"{name}.toml")


@cache
def seen(name: str) -> Seen:
    scene = scene_of(Shown.of_mission(mission(name)))
    return Seen(scene.record, scene.numbers)


def flown(text: str) -> Mission:
    return plan_mission(parse(text, "file.toml"))


@pytest.mark.parametrize("name", FLOWN)
def test_scenes_follow_their_schema(name: str) -> None:
    assert fits(seen(name).record, "Scene")
    blocks = re.findall(r"\"at\": (\d+), \"rows\": (\d+)", str(seen(name).record).replace("'", '"'))
    assert all(int(at) <= len(seen(name).bytes) for at, _ in blocks)
    kinds = {track["kind"] for track in seen(name).record["tracks"]}
    assert "executed" in kinds


def test_all_kinds_of_records_occur() -> None:
    """So that the contract is held against something: each list of a scene is filled in some example."""
    lists = [key for key, kind in fields("Scene").items() if kind.endswith("[]")]
    assert len(lists) > 12
    for key in lists:
        assert key in ("warnings", "pictures") or any(seen(name).record[key] for name in FLOWN), key
    tracks = [track["kind"] for name in FLOWN for track in seen(name).record["tracks"]]
    assert set(tracks) == {"executed", "before", "planned", "drift"}


@pytest.mark.parametrize("name", FLOWN)
def test_cubic_pieces_keep_their_stated_error(name: str) -> None:
    page, rng = seen(name), np.random.default_rng(13)
    flights = {result.number: result for result in mission(name).results}
    worst = 0.0
    for track in page.record["tracks"]:
        result = flights[track["stage"]]
        paths = {"executed": result.after, "before": result.before, "planned": result.planned}.get(
            track["kind"]
        )
        if paths is None:
            continue
        path = paths.paths[track["craft"]]
        assert (track["start"], track["end"]) == (path.start, path.end)
        times = np.sort(rng.uniform(path.start, path.end, 100))
        off = [page.state(track, time) for time in times] - path.position(times)
        worst = max(worst, np.linalg.norm(off, axis=1).max())
    wide = np.linalg.norm(np.subtract(page.record["high"], page.record["low"]))
    assert worst <= page.record["error"] <= max(1e-4 * wide, 1e-6)  # what a page of 4000 pixels cannot show


@pytest.mark.parametrize("name", ["swap_impulses", "cluster"])
def test_tracks_of_stages_are_continuous(name: str) -> None:
    page = seen(name)
    for craft in range(len(page.record["craft"])):
        ways = [t for t in page.record["tracks"] if t["kind"] == "executed" and t["craft"] == craft]
        assert [way["stage"] for way in ways] == [stage["number"] for stage in page.record["stages"]]
        for one, other in zip(ways[:-1], ways[1:], strict=True):
            jump = page.rows(one["states"])[-1, :3] - page.rows(other["states"])[0, :3]
            assert one["end"] == other["start"]
            assert np.linalg.norm(jump) <= page.record["error"]


def test_impulses_have_the_velocities_before_and_after() -> None:
    page = seen("swap_impulses")
    found = 0
    for burn in page.record["burns"]:
        way = next(
            t
            for t in page.record["tracks"]
            if (t["kind"], t["craft"], t["stage"]) == ("executed", burn["craft"], burn["stage"])
        )
        times, states = page.rows(way["times"]), page.rows(way["states"])
        for time, _, *push in page.rows(burn["rows"]):
            before, after = np.flatnonzero(times == time)[[0, -1]]
            assert states[after, 3:] - states[before, 3:] == pytest.approx(
                push, abs=1e-6 * max(1e-3, float(np.abs(states).max()))
            )
            found += 1
    assert found > 12


@pytest.mark.parametrize("name", FLOWN)
def test_delta_v_adds_up_to_that_of_the_mission(name: str) -> None:
    page, spent = seen(name), mission(name).spent_of_each[0]
    curves = {one["craft"][0]: one for one in page.record["series"] if one["kind"] == "delta-v"}
    for craft, total in enumerate(spent):
        if total == 0.0:
            assert craft not in curves
            continue
        values = page.rows(curves[craft]["values"])
        assert values[-1] == pytest.approx(total, rel=1e-6)
        assert (np.diff(values) >= -1e-6 * total).all()  # of Float32


def test_thrust_integrates_to_the_delta_v() -> None:
    """Interpolate linearly between rows, to an invisible 1e-3."""
    page = seen("cluster")
    thrust = page.record["thrusts"][0]
    time, *push = page.rows(thrust["rows"]).T.astype(float)
    size = np.linalg.norm(push, axis=0)
    assert np.trapezoid(size, time) == pytest.approx(
        mission("cluster").spent_of_each[0][thrust["craft"]], rel=1e-3
    )
    assert size.max() == pytest.approx(thrust["peak"], rel=1e-6)


def test_no_thrust_between_two_burning_stages() -> None:
    """F8 of the cluster does in the second of three stages."""
    page = seen("cluster")
    (curve,) = (one for one in page.record["series"] if one["kind"] == "thrust")
    times, values = page.rows(curve["times"]), page.rows(curve["values"])
    start, end = (page.record["stages"][1][edge] for edge in ("start", "end"))
    assert (values[(times < start) | (times > end)] == 0.0).all()
    assert (values[(times > start) & (times < end)] > 0.0).all()
    assert np.isfinite(values).all()


@pytest.mark.parametrize("name", FLOWN)
def test_ratio_curves_reach_their_certified_minimum(name: str) -> None:
    page = seen(name)
    curves = {tuple(one["craft"]): one for one in page.record["series"] if one["kind"] == "ratio"}
    for near in page.record["approaches"][:20]:
        curve = curves.get((near["first"], near["second"]))
        if curve is None:
            continue
        times, values = page.rows(curve["times"]), page.rows(curve["values"])
        inside = (times >= near["time"] - 1.0) & (times <= near["time"] + 1.0)
        assert values[inside].min() == pytest.approx(near["ratio"], rel=1e-5)


def test_pairs_have_the_zones_of_the_scenario() -> None:
    for name in FLOWN:
        page, zones = seen(name).record, mission(name).scenario.zones
        table = page["pairs"]
        assert table is not None
        for one in range(len(page["craft"])):
            for other in range(one + 1, len(page["craft"])):
                number = table["table"][table["kind"][one]][table["kind"][other]]
                moving = table["moves"][one] or table["moves"][other]
                zone = zones.between(one, other)
                assert (zone is None) == (number < 0 or not moving)
                if zone is not None:
                    axes = np.reshape(page["zones"][number]["axes"], (3, 3))
                    assert axes @ zone.matrix == pytest.approx(np.eye(3), abs=1e-12)


ZONES = {
    "sphere": cf.Sphere(20.0),
    "ellipsoid": cf.Ellipsoid([10.0, 30.0, 5.0]),
    "box": cf.Box([1.0, 2.0, 3.0]),
    "cylinder": cf.Cylinder(3.0, 8.0, [0.0, 1.0, 1.0]),
    "tetrahedron": cf.HalfSpaces([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]], [1.0, 2.0, 3.0, 4.0]),
    "plane": cf.HalfSpaces([[0.0, 1.0, 0.0]], [5.0]),
}


@pytest.mark.parametrize("zone", ZONES.values(), ids=ZONES)
def test_solids_of_zones(zone: cf.Zone) -> None:
    """`axes` takes the unit shape to the surface; flat faces are the hull of as many corners, as far out."""
    found = record(zone)
    if found["shape"] != "faces":
        rim = {"ball": [0.6, 0.0, 0.8], "box": [1.0, 0.3, -0.2], "cylinder": [0.6, 0.8, 0.1]}[found["shape"]]
        assert zone.norm(np.reshape(found["axes"], (3, 3)) @ rim) == pytest.approx(1.0)
        return
    corners = np.array(found["corners"])
    assert len(ConvexHull(corners).vertices) == len(corners) >= 4
    if zone.bounded:
        assert zone.norm(corners) == pytest.approx(1.0)
        ways = np.random.default_rng(4).normal(size=(50, 3))
        assert (ways @ corners.T).max(axis=1) == pytest.approx(zone.support(ways))


def test_corridor_and_speed_limit_are_those_of_the_stage() -> None:
    page, (result,) = seen("docking"), mission("docking").results
    corridor, limit = (result.result.required[name] for name in ("approach corridor", "speed limit"))
    (region,) = page.record["regions"]
    assert (region["name"], region["start"], region["end"]) == ("approach corridor", 0.0, result.end)
    corners = np.array(page.record["zones"][region["zone"]]["corners"]) + region["middle"]
    along = corners @ [0.0, -1.0, 0.0]
    assert along.min() == pytest.approx(0.0, abs=1e-9)
    assert along.max() == pytest.approx(200.0, rel=1e-3)  # where the path begins
    outside = corridor.margin(np.pad(corners, ((0, 0), (0, 3))))
    assert (outside <= 1e-9).all()
    assert (outside >= -0.004 * (0.5 + along * np.tan(np.radians(10.0)))).all()
    (curve,) = (one for one in page.record["series"] if one["kind"] == "speed")
    times, speed, most = (page.rows(curve[key]) for key in ("times", "values", "limit"))
    states = result.after.path("Chaser").state(times)
    assert speed == pytest.approx(np.linalg.norm(states[:, 3:], axis=1), rel=1e-6, abs=1e-9)
    assert most == pytest.approx(0.05 + 1e-3 * -states[:, 1], rel=1e-6)
    assert (speed <= most + 1e-6).all()
    assert limit.holds(result.after.path("Chaser"))


@pytest.mark.parametrize("name", ["tpf", "s04_counterexample"])
def test_attitudes_are_those_of_the_search(name: str) -> None:
    page, result = seen(name), mission(name).results[0]
    (search,) = page.record["searches"]
    times = np.random.default_rng(3).uniform(0.0, result.end - result.start, 200)
    for group in ("A", "B"):
        rows = page.rows(search["attitudes"][group])
        kept = np.append(np.diff(rows[:, 0]) > 0.0, True)
        turning = Slerp(rows[kept, 0], Rotation.from_quat(rows[kept, 1:]))
        there = turning(result.start + times).as_matrix()
        assert there == pytest.approx(result.result.search.attitude(times, group), abs=1e-9)


def test_sets_and_locks_of_a_gathering() -> None:
    page, result = seen("tpf"), mission("tpf").results[0]
    (search,) = page.record["searches"]
    rows = page.rows(search["sets"])
    assert (rows[0, 1:] == -1).all()
    assert rows[-1, 1:].tolist() == result.result.history[-1].tolist()
    for lock in page.record["locks"]:
        after = rows[rows[:, 0] >= lock["time"]][0, 1:]
        assert after[lock["first"]] == after[lock["second"]] >= 0


def test_drifts_have_their_certified_closest_approach() -> None:
    page, orbit = seen("passive_inspector"), mission("passive_inspector").orbit
    scenario = mission("passive_inspector").scenario
    drawn = [one for one in page.record["failures"] if one["track"] >= 0]
    assert drawn
    for failure in drawn:
        track = page.record["tracks"][failure["track"]]
        assert track["start"] == failure["failed_at"]
        assert track["kind"] == "drift"
        other = mission("passive_inspector").results[failure["stage"] - 1].after.paths[failure["meets"]]
        inside = min(failure["time"], other.end)
        there = orbit.transition(failure["time"] - inside) @ other.state(inside)
        gap = page.state(track, failure["time"]) - there[:3]
        zone = scenario.zones.between(failure["fails"], failure["meets"])
        near = page.record["error"] / zone.inner_radius
        assert zone.norm(gap) == pytest.approx(failure["ratio"], abs=1e-3 * failure["ratio"] + near)


def test_tubes_are_the_covariances() -> None:
    """A state's error alone moves as the transition matrix does; burns add to it."""
    page, flight = seen("three_sigmas"), mission("three_sigmas")
    assert page.record["tubes"]
    for tube in page.record["tubes"]:
        rows = page.rows(tube["rows"])
        errors = flight.results[tube["stage"] - 1].uncertain.errors[tube["craft"]]
        first = np.zeros((3, 3))
        first[np.triu_indices(3)] = rows[0, 1:]
        assert first == pytest.approx(tube["sigmas"] ** 2 * np.triu(errors.state[:3, :3]), rel=1e-6, abs=1e-9)
        later = flight.orbit.transition(float(rows[-1, 0]))[:3]
        natural = tube["sigmas"] ** 2 * later @ errors.state @ later.T
        assert rows[-1, 1] >= natural[0, 0] * (1.0 - 1e-6)
        assert rows[-1, 1] == pytest.approx(natural[0, 0], rel=0.5)  # thrust's errors are the smaller part


def test_events_are_in_order_with_descriptions() -> None:
    events = seen("cluster").record["events"]
    assert [one["time"] for one in events] == sorted(one["time"] for one in events)
    texts = [one["text"] for one in events]
    assert "F1 - F8: in conflict without avoidance, 0.6303 x zone at 3414.1 s" in texts
    assert any("F6 - F8: closest approach, 1.0000 x zone" in text for text in texts)
    assert texts[-1].startswith("clear")
    sigmas = [one["text"] for one in seen("three_sigmas").record["events"]]
    assert "Client - Inspector: fewest sigmas, 3" in sigmas
    locks = [one["text"] for one in seen("tpf").record["events"] if one["kind"] == "lock"]
    assert any("the formation set begins" in text for text in locks)


def test_failed_plan_is_shown_but_not_executed() -> None:
    """Its conflicts are those of the direct paths; nothing is spent in it."""
    text = (EXAMPLES / "cluster.toml").read_text()
    weak = flown(text.replace('max_thrust = "0.5 N"', 'max_thrust = "1 uN"'))
    scene = scene_of(Shown.of_mission(weak)).record
    assert [stage["executed"] for stage in scene["stages"]] == [True, False]
    assert "not executed" in scene["stages"][1]["title"]
    assert scene["stages"][1]["failure"] in scene["verdict"]
    assert not scene["ok"]
    assert {conflict["when"] for conflict in scene["conflicts"]} == {"before"}
    assert len(scene["conflicts"]) == 3
    assert scene["events"][-1]["level"] == "bad"
    assert not [one for one in scene["series"] if one["kind"] == "delta-v"]


HOSTILE = ("</script><script>x()", "'\"&<!--", "\u05d0\u05d1 1 - 2", "\U0001f6f0 ]]>")
TITLE = "</SCRIPT ><b onload='x()'> &lt; \u05d0\u05d1"


def test_names_are_escaped() -> None:
    names = f"[{', '.join(map(quoted, HOSTILE))}]"
    places = '["0 0 0 m", "50 0 0 m", "100 0 0 m", "150 0 0 m"]'
    toml = f"""closeform = 1
title = {quoted(TITLE)}
orbit = {{ deep_space = true }}
[craft]
name = {names}
position = {places}
velocity = "0 0 0 m/s"
keep_out = {{ sphere = "5 m" }}
[[stage]]
do = "coast"
for = "10 min"
"""
    found = flown(toml)
    page = document(scene_of(Shown.of_mission(found)))
    parts = Parts(page)
    assert [one["name"] for one in Seen.of(page).record["craft"]] == list(HOSTILE)
    assert len([tag for tag, _ in parts.tags if tag == "script"]) == 3
    assert all(name in "".join(parts.text) for name in HOSTILE)
    assert Seen.of(page).record["title"] == TITLE
    assert parts.scripts["scene"].isascii()
    assert TITLE in "".join(parts.text)


def quoted(name: str) -> str:
    """Return a TOML string."""
    return '"' + "".join(f"\\U{ord(letter):08x}" for letter in name) + '"'


def test_page_is_one_file_without_network() -> None:
    shown, pictures = Shown.of_mission(mission("cluster")), [("stage-2-thrust.png", "Thrust")]
    page = document(scene_of(shown, pictures, "report.html"))
    parts = Parts(page)
    loading = [
        (tag, name, value)
        for tag, given in parts.tags
        for name, value in given.items()
        if name in ("src", "srcset", "data") or (tag == "link" and name == "href")
    ]
    assert loading == []
    links = [given["href"] for tag, given in parts.tags if tag == "a"]
    assert links == ["report.html", "stage-2-thrust.png"]
    (policy,) = (given["content"] for tag, given in parts.tags if given.get("http-equiv"))
    assert policy.startswith("default-src 'none'; ")


def test_equal_missions_give_equal_bytes() -> None:
    again = cf.run(EXAMPLES / "cluster.toml")
    assert document(scene_of(Shown.of_mission(again))) == document(
        scene_of(Shown.of_mission(mission("cluster")))
    )


def test_day_of_eight_spacecraft_is_small() -> None:
    """The page stays below the size limit with its script, also for an hour of five spacecraft."""
    text = (EXAMPLES / "cluster.toml").read_text()
    assert text.count('for = "1 orbit"') == 1
    day = flown(text.replace('for = "1 orbit"', 'for = "1360 min"'))
    assert day.results[-1].end > 86_400.0
    assert len(document(scene_of(Shown.of_mission(day)))) < 5_000_000
    assert len(document(scene_of(Shown.of_mission(mission("find_then_fly"))))) < 1_500_000


def test_large_formations_are_shown_as_stills(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page states why; the threshold is low here, which makes the test quick."""
    monkeypatch.setattr("closeform.viewer.page.MOST", 7)
    parts = Parts(document(scene_of(Shown.of_mission(mission("cluster")))))
    assert parts.scripts == {}
    assert "8 craft; more than 7 are not animated." in "".join(parts.text)
    assert [tag for tag, _ in parts.tags].count("polyline") > 3 * 8


def test_scene_has_the_epoch_in_utc() -> None:
    text = (EXAMPLES / "cluster.toml").read_text()
    dated = text.replace("[orbit]", '[orbit]\nepoch = "2026-11-22T12:00:37.5 TAI"')
    assert scene_of(Shown.of_mission(flown(dated))).record["epoch"] == "2026-11-22T12:00:00.500Z"
    assert seen("cluster").record["epoch"] is None


def test_study_links_its_worst_cases(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With another seed than the file's, which a replay has to keep."""
    place, options = tmp_path / "study", ["--cases", "300", "--seed", "5"]
    main(["study", str(EXAMPLES / "h03.toml"), *options, "--out", str(place)])
    capsys.readouterr()
    summary = json.loads((place / "summary.json").read_text())
    report = (place / "report.html").read_text().partition("The ten largest")[0]
    cases = pyarrow.parquet.read_table(place / "cases" / "000000000.parquet").to_pydict()
    links = dict(re.findall(r'<a href="(case-\d+\.html)">(?:.*?</td><td[^>]*>){2}(.*?)</td>', report))
    assert set(links) <= set(summary["files"])
    last, most = (int(np.argmax(np.array(cases[name]))) for name in ("duration_s", "delta_v_m_s"))
    assert "gathered last" in links[f"case-{last}.html"]
    assert "highest delta-v" in links[f"case-{most}.html"]
    for case in (last, most):
        page = Seen.of((place / f"case-{case}.html").read_text())
        assert page.record["end"] == pytest.approx(cases["duration_s"][case])
        spent = [page.rows(one["values"])[-1] for one in page.record["series"] if one["kind"] == "delta-v"]
        assert sum(spent) == pytest.approx(cases["delta_v_m_s"][case], rel=1e-5)
        assert page.record["report"] == "report.html"
    assert {int(name[5:-5]) for name, why in links.items() if "not clear" in why} <= {
        case for case, clear in enumerate(cases["clear"]) if not clear
    }


def test_screened_ephemerides_and_messages_have_a_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The two GRACE spacecraft in samples, without known thrust; in UTC, from files in GPS time."""
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    files = [str(EXAMPLES / "grace" / f"GRACE-{letter}.oem") for letter in "AB"]
    options = ["--ellipsoid", "20 40 20 m", "--out", str(tmp_path / "screen")]
    assert main(["screen", *files, *options]) == 0
    page = Seen.of((tmp_path / "screen" / "viewer.html").read_text())
    assert fits(page.record, "Scene")
    assert page.record["epoch"] == "2010-07-26T23:59:45.000Z"
    frame = common_frame([read_oem(file) for file in files])
    (track,) = (one for one in page.record["tracks"] if one["craft"] == 1)
    for time, state in list(zip(frame.times, frame.states[1], strict=True))[5:-5:100]:
        assert np.linalg.norm(page.state(track, time) - state[:3]) <= page.record["error"]
    assert not page.record["thrusts"]
    assert not any(craft["moves"] for craft in page.record["craft"])

    assert main(["encounter", str(EXAMPLES / "slow_encounter.cdm"), "--out", str(tmp_path / "met")]) == 0
    met = Seen.of((tmp_path / "met" / "viewer.html").read_text())
    assert fits(met.record, "Scene")
    found = float(met.record["verdict"].split("collision probability")[-1])
    assert found == pytest.approx(0.02682, rel=2e-3)  # its own interval is 0.1 % on either side
    assert len(met.record["tubes"]) == 2
    capsys.readouterr()
