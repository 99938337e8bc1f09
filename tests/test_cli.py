"""The command line: output, results and exit status."""

import json
import re
import resource
import subprocess
import sys
import webbrowser
from _thread import interrupt_main
from pathlib import Path
from threading import Thread
from urllib.request import urlopen

import numpy as np
import pyarrow.parquet
import pytest
from scipy.integrate import solve_ivp

import closeform as cf
from closeform.cli.app import main
from closeform.cli.console import WIDTH
from closeform.scenario import load
from closeform.storage.publishing import folder
from closeform.storage.result_folder import FolderError
from orbit_files import contents, oem
from pages import assert_linked
from runs import numbers
from scenarios import GOOD

pytestmark = pytest.mark.usefixtures("undrawn")

CLUSTER = Path(__file__).parents[1] / "examples" / "cluster.toml"
FILES = {
    *("scenario.toml", "summary.json", "report.html", "viewer.html"),
    *("conflicts.parquet", "approaches.parquet", "paths.parquet", "craft.parquet"),
}


@pytest.fixture(scope="module")
def cluster_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Results and output of the cluster example, run in another process."""
    place = tmp_path_factory.mktemp("cluster_run")
    command = [sys.executable, "-m", "closeform", "run", str(CLUSTER)]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return place / "cluster-results", done.stdout


def table(folder: Path, name: str) -> dict[str, list]:
    return pyarrow.parquet.read_table(folder / f"{name}.parquet").to_pydict()


def test_help_is_quick_and_imports_nothing_heavy() -> None:
    heavy = ("numpy", "numba", "matplotlib", "pydantic", "astropy", "pandas")
    heavy += ("hashlib", "importlib.metadata")
    code = (
        "import sys; from closeform.cli.app import main; main(['--help']);"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    took = []
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        took.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    assert done.stdout.splitlines()[-1] == "[]"
    # s of processor time, because the machine may be busy
    assert min(took) < 0.3


def test_folder_is_complete(cluster_run: tuple[Path, str]) -> None:
    results, printed = cluster_run
    names = {file.name for file in results.iterdir()}
    assert names >= FILES
    pictures = {"distances", "two-ways", "before-after", "nearness", "thrust"}
    assert {name for name in names if name.endswith(".png")} >= {f"stage-2-{name}.png" for name in pictures}
    assert list(results.parent.iterdir()) == [results]
    assert (results / "scenario.toml").read_text() == CLUSTER.read_text()
    assert "clear in Hill's equations: no conflict remains" in printed


def test_conflicts_before_agree_with_sampling_an_integration(cluster_run: tuple[Path, str]) -> None:
    """Integrate Hill's equations under the thrust of the optimal transfer."""
    results, _ = cluster_run
    scenario = load(CLUSTER)
    n = scenario.orbit.build().mean_motion
    period = 2 * np.pi / n
    move = scenario.stages[1]
    states = np.array([craft.state(scenario.orbit.build()) for craft in scenario.craft])
    times = np.linspace(0.25, 1.0, 8001) * period
    direct = cf.Orbit(n).transfer(
        cf.Orbit(n).transition(0.25 * period) @ states[7],
        move.to.state(cf.Orbit(n)),
        0.75 * period,
        0.25 * period,
    )

    def motion(t: float, s: np.ndarray, thrust: bool) -> np.ndarray:
        push = direct.thrust(min(max(t, times[0]), times[-1])) if thrust else np.zeros(3)
        x, _, z, vx, vy, vz = s
        return np.array([vx, vy, vz, 3 * n * n * x + 2 * n * vy, -2 * n * vx, -n * n * z]) + np.array(
            [0, 0, 0, *push]
        )

    flights = []
    for k, state in enumerate(states):
        begun = solve_ivp(motion, (0, times[0]), state, args=(False,), rtol=1e-10, atol=1e-10).y[:, -1]
        solved = solve_ivp(
            motion,
            times[[0, -1]],
            begun,
            t_eval=times,
            args=(k == 7,),
            rtol=1e-10,
            atol=1e-10,
            method="DOP853",
        )
        flights.append(solved.y[:3].T)
    rows = table(results, "conflicts")
    before = [k for k, when in enumerate(rows["when"]) if when == "before"]
    found = {}
    for other in range(7):
        inside = np.linalg.norm((flights[7] - flights[other]) / [20.0, 40.0, 20.0], axis=1) <= 1.0
        if inside.any():
            found[f"F{other + 1}"] = times[inside][[0, -1]]
    assert {rows["first"][k] for k in before} == set(found)
    assert {rows["second"][k] for k in before} == {"F8"}
    for k in before:  # sampled every 0.53 s
        first, last = found[rows["first"][k]]
        assert rows["start_s"][k] == pytest.approx(first, abs=0.6)
        assert rows["end_s"][k] == pytest.approx(last, abs=0.6)


def test_written_paths_are_clear_and_meet_the_goal(cluster_run: tuple[Path, str]) -> None:
    results, _ = cluster_run
    assert "after" not in table(results, "conflicts")["when"]
    rows = {key: np.array(value) for key, value in table(results, "paths").items()}
    position = np.stack([rows[key] for key in ("x_m", "y_m", "z_m")], axis=-1).reshape(3, 8, -1, 3)
    gaps = np.linalg.norm((position[:, :, None] - position[:, None]) / [20.0, 40.0, 20.0], axis=-1)
    gaps[:, range(8), range(8)] = np.inf
    assert gaps.min() > 1.0
    scenario = load(CLUSTER)
    goal = scenario.stages[1].to.state(scenario.orbit.build())
    # 200 m across: a micrometre is 5e-9 of it, and the transfer promises 1e-9 of |v| T as well
    np.testing.assert_allclose(position[1, 7, -1], goal[:3], atol=1e-6)
    np.testing.assert_allclose(position[2, :, 0], position[1, :, -1], atol=1e-6)


def test_summary_holds_every_printed_figure(cluster_run: tuple[Path, str]) -> None:
    results, printed = cluster_run
    summary = json.loads((results / "summary.json").read_text())
    assert summary["closeform"] == 1
    assert summary["status"] == 0
    assert summary["seed"] is None
    assert list(summary["inputs"]) == ["cluster.toml"]
    assert {"closeform", "numpy", "numba", "python"} <= set(summary["versions"])

    kept = numbers(summary)
    stage = summary["stages"][1]["change"]
    for key in ("energy_m2_s3", "delta_v_m_s", "peak_thrust_m_s2"):
        kept.append(100 * (stage["around"][key] / stage["direct"][key] - 1))  # the line "change"
    kept.append(100 * stage["gap"])  # printed in percent
    price = stage["clearance_per_metre_m_s3"]
    kept.append(100 * price / stage["around"]["energy_m2_s3"])
    kept += [100 * one["per_metre_m_s3"] / price for one in stage["clearance"]]
    for row in summary["used"]:
        kept += [100 * row[f"share_of_{limit}"] for limit in ("delta_v_budget", "max_thrust")]
    kept += [1e3 * value for value in kept] + [2 * np.pi / summary["mean_motion_rad_s"] / 60]
    kept += [c["end_s"] - c["start_s"] for c in summary["stages"][1]["before"]["conflicts"]]
    body = printed.split("\n", 2)[2]
    for text in re.findall(r"(?<![\w.])[+-]?\d+\.\d+(?:e[+-]?\d+)?", body):
        digits = len(text.lstrip("+-").split("e")[0].replace(".", "").lstrip("0"))
        shown = float(text)
        step = 10.0 ** (np.floor(np.log10(abs(shown))) - digits + 1) if shown else 0.1
        assert any(abs(value - shown) <= 0.51 * step for value in kept), f"{text} is not in summary.json"


def test_report_is_self_contained(cluster_run: tuple[Path, str]) -> None:
    results, _ = cluster_run
    page = (results / "report.html").read_text()
    assert_linked(results)
    assert page.count("<figure>") == len(list(results.glob("*.png")))
    assert "prefers-color-scheme: dark" in page


def test_results_are_replaced_only_with_overwrite(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text(GOOD)
    assert main(["run", "good.toml", "--out", "deep/here", "--no-viewer"]) == 0
    assert not Path("deep/here/viewer.html").exists()
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert main(["view", "deep/here"]) == 0
    assert opened == [Path("deep/here/report.html").resolve().as_uri()]  # there is no viewer
    kept = contents(Path("deep/here"))
    assert main(["run", "good.toml", "--out", "deep/here"]) == 2
    assert contents(Path("deep/here")) == kept
    Path("good.toml").write_text(GOOD.replace("Three craft", "Three <b>craft</b>"))
    assert main(["run", "good.toml", "--out", "deep/here", "--overwrite"]) == 0
    assert "<h1>Three &lt;b&gt;craft&lt;/b&gt;</h1>" in Path("deep/here/report.html").read_text()
    assert [file.name for file in Path("deep").iterdir()] == ["here"]


def test_interrupted_run_leaves_nothing(tmp_path) -> None:
    place = tmp_path / "results"

    def stopped() -> None:
        with folder(place) as under_way:
            under_way.summary({"status": 0})
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert list(tmp_path.iterdir()) == []


def test_unwritable_folder_is_refused(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FolderError, match="choose another --out"), folder(tmp_path / "file" / "results"):
        pytest.fail("there is no such place")


def run(tmp_path: Path, text: str) -> tuple[int, dict]:
    (tmp_path / "case.toml").write_text(text)
    status = main(["run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "results"), "--overwrite"])
    return status, json.loads((tmp_path / "results" / "summary.json").read_text())


def test_remaining_conflict_gives_status_1(tmp_path, capsys) -> None:
    """F1 drifts 1 m/s along-track in deep space, from 80 s to 120 s in F2's zone."""
    text = (
        GOOD.split("[[stage]]\nname")[0]
        .replace('altitude = "500 km"', "deep_space = true")
        .replace('velocity = "0 0 0 m/s"', 'velocity = ["0 1 0 m/s", "0 0 0 m/s", "0 0 0 m/s"]')
        .replace("5 min", "150 s")
    )
    status, summary = run(tmp_path, text)
    assert status == 1
    (conflict,) = summary["stages"][0]["after"]["conflicts"]
    assert conflict["pair"] == ["F1", "F2"]
    assert (conflict["start_s"], conflict["end_s"]) == pytest.approx((80.0, 120.0), abs=1e-6)
    assert conflict["ratio"] == pytest.approx(0.0, abs=1e-9)
    assert "1 conflict remains" in capsys.readouterr().out


def test_goal_inside_a_zone_stops_the_mission(tmp_path, capsys) -> None:
    """F3 cannot end 10 m from F2, which does not drift."""
    status, summary = run(tmp_path, GOOD.replace("0 -100 0 m", "0 110 0 m"))
    assert status == 1
    assert summary["stages"][1]["change"]["ok"] is False
    assert summary["stages"][1]["change"]["around"] is None
    assert summary["stages"][1]["change"]["status"] == "start or end inside a zone"
    assert "stopped in stage 2 (avoid)" in capsys.readouterr().out


def test_both_methods_beside_a_moving_spacecraft(tmp_path, capsys) -> None:
    """F3 moves along the string of pearls while F1 moves aside."""
    fellow = 'meanwhile = [{ craft = "F1", to = { position = "0 0 60 m", velocity = "0 0 0 m/s" } }]\n'
    text = GOOD.replace("0.1 orbits", "5 min").replace("1.5 N", "15 N")
    spent = {}
    for method in ("exact", "sauter-palmer"):
        status, summary = run(tmp_path, f'{text}method = "{method}"\n{fellow}')
        assert status == 0
        change = summary["stages"][1]["change"]
        assert summary["stages"][1]["before"]["conflicts"]
        assert change["contacts"] or method == "sauter-palmer"
        assert change["around"]["energy_m2_s3"] >= change["direct"]["energy_m2_s3"]
        spent[method] = change["around"]["energy_m2_s3"]
    assert spent["exact"] <= spent["sauter-palmer"] * (1 + 1e-9)


def test_thrust_and_delta_v_limits_are_checked(tmp_path, capsys) -> None:
    text = GOOD.replace("keep_out", 'delta_v_budget = "1 mm/s"\nkeep_out')
    status, summary = run(tmp_path, text)
    assert status == 1
    (leg,) = [stage for stage in summary["stages"] if stage["do"] == "avoid"]
    assert summary["warnings"] == [
        f"F3 needs {leg['change']['around']['delta_v_m_s']:.4g} m/s, its delta_v_budget is 0.001 m/s",
    ]
    assert summary["warnings"][0] in capsys.readouterr().out
    status, summary = run(tmp_path, text.replace('"1.5 N"', '"1 uN"'))
    assert status == 1
    assert re.match(
        r"stopped in stage 2 \(avoid\): F3 needs \S+ N in \S+ s, its max_thrust is 1e-06 N; ",
        summary["verdict"],
    )
    assert summary["warnings"] == []  # it is not executed


def test_check(tmp_path, capsys) -> None:
    assert main(["check", str(CLUSTER)]) == 0
    assert "valid: 8 craft; stages: coast, avoid, coast" in capsys.readouterr().out
    assert main(["check", str(CLUSTER.with_name("f6_scatter.toml"))]) == 0
    printed = " ".join(capsys.readouterr().out.split())  # a long path wraps
    assert "valid: 8 craft; stages: coast, scatter, coast, regather" in printed


def test_view(cluster_run: tuple[Path, str], monkeypatch, capsys) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    for options, name in (([], "viewer.html"), (["--report"], "report.html")):
        assert main(["view", str(cluster_run[0]), *options]) == 0
        assert opened.pop() == (cluster_run[0] / name).resolve().as_uri()
        assert capsys.readouterr().out.rstrip() == str((cluster_run[0] / name).resolve())


def test_view_serves_the_folder_until_interrupted(cluster_run: tuple[Path, str], monkeypatch) -> None:
    served: list[bytes] = []

    def fetch(address: str) -> None:
        with urlopen(address, timeout=30) as answer:
            served.append(answer.read())
        interrupt_main()

    monkeypatch.setattr(webbrowser, "open", lambda address: Thread(target=fetch, args=(address,)).start())
    assert main(["view", str(cluster_run[0]), "--serve"]) == 0
    assert served == [(cluster_run[0] / "viewer.html").read_bytes()]


def test_screen(tmp_path, monkeypatch, capsys) -> None:
    """B is 0.0001 rad, 700 m, ahead of A on the same circle."""
    monkeypatch.chdir(tmp_path)
    for name, ahead in (("A", 0.0), ("B", 1e-4)):
        (tmp_path / f"{name}.oem").write_text(oem(name, ahead))
    files = [str(tmp_path / "A.oem"), str(tmp_path / "B.oem")]
    assert main(["screen", *files, "--sphere", "500 m"]) == 0
    assert "Conflicts: none; closest approach A - B, 1.4000 x zone (700.000 m)" in capsys.readouterr().out
    assert main(["screen", *files, "--ellipsoid", "20 800 20 m"]) == 1
    printed = capsys.readouterr().out
    assert re.search(r"A - B +0\.000 +00:00:00\.000 +600\.000 +600\.000 ", printed)
    assert "0.8750 x zone" in printed
    assert max(map(len, printed.splitlines())) <= WIDTH
    # 3 sigma along the track are 600 m for one and 849 m for both
    unsure = ["--covariance", "25 0 40000 0 0 25 m^2", "--sigmas", "3"]
    assert main(["screen", *files, *unsure]) == 1
    printed = capsys.readouterr().out
    assert "Zones of pairs: covariances added, 3 sigma" in printed
    assert "0.8250 x zone" in printed  # 700 / (3 x 200 x sqrt 2)
    assert main(["screen", *files, "--sphere", "400 m"]) == 0
    assert "Zones of pairs" not in capsys.readouterr().out
    assert main(["screen", *files, "--sphere", "400 m", "--body"]) == 1
    assert "Zones of pairs: bodies added" in capsys.readouterr().out


def test_ctrl_c(tmp_path, monkeypatch, capsys) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text(GOOD)
    monkeypatch.setattr("closeform.report.page.drawn", interrupted)
    assert main(["run", "good.toml"]) == 130
    assert capsys.readouterr().err == "closeform: stopped by the keyboard; nothing was written\n"
    assert [file.name for file in tmp_path.iterdir()] == ["good.toml"]


def test_deleted_current_folder_is_reported_in_one_line(tmp_path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    command = f'rmdir "{gone}"; exec "{sys.executable}" -m closeform check x.toml'
    done = subprocess.run(["sh", "-c", command], cwd=gone, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.startswith("closeform: the current folder: ")
    assert len(done.stderr.splitlines()) == 1


def test_control_characters_are_not_printed(tmp_path, monkeypatch, capsys) -> None:
    """Neither output nor messages contain control characters of names."""
    monkeypatch.chdir(tmp_path)
    for name, y in (("A", 0.0), ("B", 5.0)):
        (tmp_path / f"{name}.oem").write_text(oem(f"{name}\x1b]0;owned\x07", y))
    main(["screen", "A.oem", "B.oem", "--sphere", "20 m"])
    (tmp_path / "bad.oem").write_text(oem("A", 0.0).replace("EARTH", "EA\x1b[2JRTH"))
    assert main(["screen", "A.oem", "bad.oem", "--sphere", "20 m"]) == 2
    told = capsys.readouterr()
    assert "A\\x1b]0;owned" in told.out
    assert "differs from EARTH" in told.err
    assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", told.out + told.err)


@pytest.mark.parametrize(
    ("example", "old", "new", "key"),
    [
        ("cluster", 'altitude = "500 km"', 'altitude = "600 m"', "orbit.altitude"),
        ("simulated_cases", 'velocity = "0 0 0 m/s"\nkeep', 'velocity = "0 7 0 km/s"\nkeep', "7000 m/s"),
    ],
)
def test_doubtful_scenario_gives_one_warning(example, old, new, key, tmp_path, capsys):
    text = (Path(__file__).parent.parent / "examples" / f"{example}.toml").read_text()
    assert old in text
    (tmp_path / "doubtful.toml").write_text(text.replace(old, new))
    (tmp_path / "sound.toml").write_text(text)
    main(["check", str(tmp_path / "doubtful.toml")])
    warned = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(warned) == 1
    assert key in warned[0]
    assert main(["check", str(tmp_path / "sound.toml")]) == 0
    assert capsys.readouterr().err == ""
