"""report.html: requirements, delta-v budget, model error and reproduction; pages of screenings."""

import json
import re
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.cli.app import main
from closeform.exchange.ccsds.oem import read_oem
from closeform.mission.mission import plan_mission
from closeform.report import run
from closeform.report.run import RunReport
from closeform.report.sections import effort, model_limits
from closeform.scenario import parse
from closeform.storage.result_folder import Folder
from orbit_files import oem
from pages import assert_linked
from scenarios import GOOD

LIMITED = (
    "# Three in a row; the last\n# goes past both.\n"
    + GOOD.replace(
        'max_thrust = "1.5 N"',
        'max_thrust = "1.5 N"\nspecific_impulse = "220 s"\npropellant = "2 kg"\ndelta_v_budget = "5 m/s"',
    )
    + '[[stage]]\ndo = "transfer"\ncraft = "F3"\ncost = "delta-v"\n'
    'to = { position = "0 200 0 m", velocity = "0 0 0 m/s" }\nwithin = "0.6 orbits"\n'
)
ORDER = [
    "Request",
    "Results",
    "Budget",
    "Stage 1",
    "Stage 2",
    "Stage 3",
    "Limits of the model",
    "Reproduction",
]


class Headings(HTMLParser):
    """The headings of a page in order, each with its level."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[int, str]] = []
        self.level = 0
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.level = int(tag[1]) if re.fullmatch("h[1-6]", tag) else self.level
        if self.level and tag[0] == "h":
            self.found.append((self.level, ""))

    def handle_endtag(self, tag):
        self.level = 0 if re.fullmatch("h[1-6]", tag) else self.level

    def handle_data(self, data):
        if self.level:
            self.found[-1] = self.level, self.found[-1][1] + data


@pytest.fixture(scope="module")
def report():
    return RunReport(plan_mission(parse(LIMITED, "limited.toml")))


@pytest.fixture(scope="module")
def handed_in(report, tmp_path_factory):
    """The page without its pictures, in its folder."""
    place = tmp_path_factory.mktemp("handed_in")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("closeform.report.page.drawn", lambda *_: ())
        report.write(Folder(place))
    return place


def rows(page, title):
    """The rows of the table that stands under a title."""
    (body,) = re.findall(rf'aria-label="{re.escape(title)}"><table>.*?<tbody>(.*?)</tbody>', page)
    return [
        [unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", body)
    ]


def test_page_starts_with_requirements_and_ends_with_reproduction(handed_in):
    page = (handed_in / "report.html").read_text()
    headings = Headings(page).found
    assert [text for level, text in headings if level == 1] == ["Three craft"]
    chapters = [text for level, text in headings if level == 2]
    assert [text.split(":")[0].split(' "')[0] for text in chapters] == ORDER
    assert all(after - before <= 1 for (before, _), (after, _) in zip(headings, headings[1:], strict=False))
    assert page.index('class="verdict good"') < page.index("<nav") < page.index("<main>")
    contents = re.findall(r'<li><a href="#(.*?)">(.*?)</a></li>', page)
    assert [unescape(words) for _, words in contents] == chapters
    assert_linked(handed_in)
    assert "<td>the same, in this folder</td><td>closeform run scenario.toml</td>" in re.sub(
        r"<td [^>]*>", "<td>", page
    )
    files = {name for name, *_ in rows(re.sub("</?a[^>]*>", "", page), "Files next to this page")}
    assert files == {file.name for file in handed_in.iterdir()} - {"report.html"}


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, None),  # thrust at the limit, with the mass that is left
        ({'"1.5 N"': '"0.5 N"'}, 'Stage 2 "pass": avoid: within'),  # takes longer
        ({'"5 m/s"': '"1 m/s"'}, "Delta-v of each craft"),
        ({'propellant = "2 kg"': 'propellant = "50 g"'}, "Propellant of each craft"),
        ({'"0 200 0 m", vel': '"0 10 0 m", vel'}, "No craft enters"),  # 10 m from F1
    ],
)
def test_each_requirement_has_its_row(changes, broken):
    """Only the requirement made impossible is not met; all together are the verdict."""
    text = LIMITED
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    mission = plan_mission(parse(text))
    told = list(run.requirements(mission))
    unmet = [what for what, _, met in told if met is False]  # None: within the model error, not shown
    assert (not unmet) == mission.verdict.ok
    assert len(unmet) == (broken is not None), told
    assert broken is None or unmet[0].startswith(broken)
    assert len(told) == 6  # clearance, three limits, two stages that are to end in time


def test_delta_v_budget_adds_up(report):
    """In all and by stage as Tsiolkovsky and dense samples of the thrust have it."""
    mission = report.mission
    stages = report.summary["budget"]
    spent = {name: sum(stage["delta_v_m_s"][name] for stage in stages) for name in ("F1", "F2", "F3")}
    assert spent == pytest.approx(report.summary["delta_v_m_s"])
    burnt = 150.0 * (1.0 - np.exp(-spent["F3"] / (220.0 * 9.80665)))
    assert sum(stage["propellant_kg"]["F3"] for stage in stages) == pytest.approx(burnt, rel=1e-9)
    for stage, result in zip(stages, mission.results, strict=True):
        path = result.after.path("F3")
        times = np.linspace(result.start, result.end, 40001)
        step = times[1] - times[0]
        on = (
            np.linalg.norm(path.thrust(times), axis=1) > 1e-9 * path.peak_thrust
            if path.delta_v
            else times < 0
        )
        assert stage["under_thrust_s"]["F3"] == pytest.approx(
            on.sum() * step, abs=12 * step
        )  # edges of burns
    assert 0.0 < stages[2]["under_thrust_s"]["F3"] < 0.9 * (mission.results[2].end - mission.results[2].start)
    told = effort.budget(mission, report.thrusting)
    every, *by_stage = told.tables
    assert [table.title for table in by_stage] == [
        "Delta-v by stage [m/s]",
        "Propellant by stage [kg]",
        "Under thrust by stage [s]",
    ]
    for table in by_stage:
        *craft, total = table.rows
        assert total[1:] == pytest.approx(np.sum([row[1:] for row in craft], axis=0), nan_ok=True)
    assert every.rows[2][1] == pytest.approx(spent["F3"])


def orbits(states, period):
    """Where craft are after one orbit in the Earth's field alone."""
    mu = cf.elements.EARTH_MU

    def field(_, state):
        return [*state[3:], *(-mu * state[:3] / np.linalg.norm(state[:3]) ** 3)]

    return np.array(
        [solve_ivp(field, (0.0, period), state, "DOP853", rtol=1e-12, atol=1e-6).y[:, -1] for state in states]
    )


@pytest.mark.parametrize("far", [300.0, 3000.0])
def test_model_error_on_a_circular_orbit(far):
    """A craft that far ahead on the same circle, integrated: the rule of the curvature to a hundredth."""
    orbit = cf.Orbit.circular(500e3)
    a = cf.elements.semi_major_axis_from_mean_motion(orbit.mean_motion)
    pair = cf.elements.inertial_from_elements([[a, angle, 0.0, 0.0, 0.9, 0.3] for angle in (0.0, far / a)])
    start = cf.elements.relative_from_inertial(*pair)
    truth = cf.elements.relative_from_inertial(*orbits(pair, orbit.period))
    off = np.linalg.norm(orbit.coast(start, orbit.period).position(orbit.period) - truth[:3])
    reach = model_limits.Reach("B", far, 0.0, 20.0)
    (bend, *_) = model_limits.deviations(reach, model_limits.Circle(orbit.mean_motion))
    assert bend[2] == pytest.approx(off, rel=0.01)
    limit = float(bend[3].split()[0])  # at which it is a tenth of the zone, which is 20 m
    assert bend[2] * (limit / far) ** 2 == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("eccentricity", [3e-4, 3e-3])
def test_model_error_on_an_eccentric_orbit(eccentricity):
    """Start and direction decide: of many the worst is within the rule, and above a quarter of it."""
    a, far, rng = 6.85e6, 100.0, np.random.default_rng(6)
    orbit = cf.Orbit.from_semi_major_axis(a)
    worst = 0.0
    for _ in range(24):
        latitude, way = rng.uniform(0.0, 2.0 * np.pi, 2)
        chief = np.array([a, latitude, eccentricity * np.cos(way), eccentricity * np.sin(way), 1.0, 0.2])
        roe = rng.normal(size=6) * [0.0, 1.0, 0.5, 0.5, 0.5, 0.5]
        deputy = cf.elements.elements_from_roe(chief, roe * far / a)
        pair = cf.elements.inertial_from_elements([chief, deputy])
        start = cf.elements.relative_from_inertial(*pair)
        path = orbit.coast(start, orbit.period)
        distance = np.linalg.norm(path.position(np.linspace(0.0, orbit.period, 200)), axis=1).max()
        off = np.linalg.norm(
            path.position(orbit.period) - start[:3]
        )  # one period: in truth back at the start
        worst = max(worst, off / distance)
    rows = model_limits.deviations(
        model_limits.Reach("B", far, 0.0, 20.0),
        model_limits.Circle(orbit.mean_motion, eccentricity=eccentricity),
    )
    told = next(row for row in rows if "e =" in row[0])
    assert 0.25 * told[2] < worst * far < 1.05 * told[2]


@pytest.mark.parametrize(
    ("model", "neglected"), [("eccentric", ["curvature", "oblateness"]), ("j2", ["curvature"])]
)
def test_effects_that_the_model_includes_are_not_listed(model, neglected):
    """Kepler's ellipse includes the eccentricity, and J2 the oblateness as well."""
    orbit = cf.Orbit.eccentric(0.15, 8.2e6)
    if model == "j2":
        orbit = cf.Orbit.perturbed(0.15, 0.9, 8.2e6, span=9e3)
    circle = model_limits.Circle(2.0 * np.pi / orbit.period, eccentricity=0.15)
    reach = model_limits.Reach("B", 250.0, 0.0, 5.0)
    (_, _), (table,) = model_limits.beyond(reach, orbit, circle, 3600.0)
    causes = [row[0] for row in table.rows]
    assert len(causes) == len(neglected)
    assert all(effect in cause for effect, cause in zip(neglected, causes, strict=True))


def test_model_error_is_that_of_the_farthest_spacecraft():
    """Of two flights one after another, against dense samples."""
    mission = plan_mission(parse(LIMITED))
    flights = [result.after for result in mission.results]
    reach = model_limits.Reach.of(flights)
    far = max(
        float(
            np.linalg.norm(flight.paths.position(np.linspace(result.start, result.end, 5001)), axis=-1).max()
        )
        for flight, result in zip(flights, mission.results, strict=True)
    )
    assert reach.distance == pytest.approx(far, rel=1e-3)
    assert (reach.craft, reach.smallest) == ("F3", 20.0)


@pytest.fixture
def desk(tmp_path, monkeypatch):
    for name, ahead in (("A", 0.0), ("B", 1e-4)):  # by 700 m
        (tmp_path / f"{name}.oem").write_text(oem(name, ahead))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_screening_writes_the_files_of_a_run(desk, capsys):
    """Printed tables, states of the common frame, pictures and page are all listed in the summary."""
    assert main(["screen", "A.oem", "B.oem", "--ellipsoid", "20 800 20 m"]) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "1 conflict remains; results in A-screen-results"
    place = desk / "A-screen-results"
    summary = json.loads((place / "summary.json").read_text())
    assert set(summary["files"]) == {file.name for file in place.iterdir()}
    tables = {name: pyarrow.parquet.read_table(place / f"{name}.parquet").to_pydict() for name in
              ("states", "conflicts", "approaches")}  # fmt: skip
    frame = cf.common_frame([read_oem("A.oem"), read_oem("B.oem")])
    kept = np.array(
        [tables["states"][name] for name in ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")]
    ).T
    assert (kept.reshape(2, 11, 6) == frame.states).all()
    assert tables["states"]["time_s"] == [*frame.times, *frame.times]
    assert tables["conflicts"]["ratio"] == [pytest.approx(0.875, abs=1e-4)]  # 700 of 800 m
    assert tables["conflicts"]["end_s"] == [600.0]
    assert tables["approaches"]["distance_m"] == [pytest.approx(700.0, abs=0.1)]
    assert (summary["kind"], summary["status"], summary["conflicts"]) == ("screen", 1, 1)
    assert summary["command"] == 'closeform screen A.oem B.oem --ellipsoid "20 800 20 m"'
    page = (place / "report.html").read_text()
    assert summary["command"] in unescape(page)
    assert page.count("<figure>") == len(list(place.glob("*.png"))) > 1
    assert all(len(told) > 20 for told in re.findall(r'<img alt="([^"]*)"', page))
    assert_linked(place)


def test_screenings_have_separate_folders(desk, monkeypatch, capsys):
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    for place in ("A-screen-results", "A-screen-results-2"):
        assert main(["screen", "A.oem", "B.oem", "--sphere", "20 m"]) == 0
        assert capsys.readouterr().out.endswith(f"; results in {place}\n")
    assert main(["screen", "A.oem", "B.oem", "--sphere", "20 m", "--out", "A-screen-results"]) == 2
    assert "holds finished results; add --overwrite" in capsys.readouterr().err
    again = ["screen", "A.oem", "B.oem", "--sphere", "30 m", "--out", "A-screen-results", "--overwrite"]
    assert main(again) == 0
    summary = json.loads(Path("A-screen-results/summary.json").read_text())
    assert summary["command"].endswith('--sphere "30 m"')  # where results went is not part of it
    assert sorted(file.name for file in desk.iterdir() if file.is_dir()) == [
        "A-screen-results",
        "A-screen-results-2",
    ]


def test_conjunction_writes_its_motion_and_figures(desk, capsys):
    message = Path(__file__).parents[1] / "examples" / "slow_encounter.cdm"
    assert main(["encounter", str(message), "--out", "met"]) == 0
    printed = capsys.readouterr().out
    summary = json.loads(Path("met/summary.json").read_text())
    values = {row["figure"]: row["value"] for row in summary["probabilities"]}
    assert f"collision probability {values['ever inside']:.5g}; results in met" in printed
    assert summary["kind"] == "encounter"
    states = pyarrow.parquet.read_table("met/states.parquet").to_pydict()
    places = np.array([states[name] for name in ("x_m", "y_m", "z_m")]).T.reshape(2, -1, 3)
    apart = np.linalg.norm(places[1] - places[0], axis=1)
    assert apart[len(apart) // 2] == pytest.approx(
        summary["miss_distance_m"], abs=1e-6
    )  # at closest approach
    page = Path("met/report.html").read_text()
    assert page.count("<figure>") == 3
    assert_linked(Path("met"))
