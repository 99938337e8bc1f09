"""`closeform encounter` and `screen --sigmas`, against published conjunctions and samples."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import binomtest

import closeform as cf
from cdms import FAST, MEDIUM, SLOW
from closeform.cli.app import main

NUMBER = r"(-|[-+.e\d]+)"


@pytest.fixture(autouse=True)
def desk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    for name, text in (("slow", SLOW), ("medium", MEDIUM), ("fast", FAST)):
        (tmp_path / f"{name}.cdm").write_text(text)
    return tmp_path


def verdict(printed):
    """Return the verdict of the last line."""
    return re.fullmatch(r"(.*); results in \S+", printed.splitlines()[-1])[1]


def figure(name, printed):
    """Return the numbers of a row of the table of probabilities."""
    found = re.search(
        rf"^{re.escape(name)} .*?  +{NUMBER}  +(?:-|{NUMBER} to {NUMBER})$", printed, re.MULTILINE
    )
    return tuple(float(value) for value in found.groups() if value is not None)


def test_slow_conjunction_of_alfano(capsys):
    """CARA's Monte Carlo of Alfano's case 8 gives 0.035201 to 0.035274 (95 %)."""
    assert main(["encounter", "medium.cdm", "--window", "10135 s"]) == 0
    printed = capsys.readouterr().out
    value, low, high = figure("ever inside", printed)
    assert 0.035201 < value < 0.035274
    assert low <= value <= high
    assert high - low < 0.002 * value
    assert figure("short encounter (2-D)", printed)[0] < 0.97 * value  # straight motion misses the rest
    assert "Radius of both bodies 4 m; evaluated for 10135 s before and after" in printed
    assert "Clear by 0 sigmas" in printed  # 2.95 m apart, with bodies of 4 m
    assert "Warning" not in printed


def test_eccentric_orbit(capsys):
    """CARA's Monte Carlo of Alfano's case 1, e = 0.012, gives 0.216785 to 0.216946 (95 %)."""
    assert main(["encounter", "slow.cdm", "--window", "21600 s"]) == 0
    printed = capsys.readouterr().out
    assert 0.216785 < figure("ever inside", printed)[0] < 0.216946
    assert figure("short encounter (2-D)", printed)[0] < 0.7 * 0.216865
    assert "Warning" not in printed


def test_fast_conjunction_agrees_with_its_message(capsys):
    """The message's 0.004450713 is that of a square, 4 / pi of the circle's."""
    assert main(["encounter", "fast.cdm"]) == 2
    refused = capsys.readouterr().err
    assert refused.startswith("fast.cdm: contains no hard-body radius; give one: ")
    radius = re.search(r'--radius "(.*)" is the sum of the exclusion radii', refused)[1]
    assert main(["encounter", "fast.cdm", "--radius", radius]) == 0
    printed = capsys.readouterr().out
    stated = figure("the message", printed)[0]
    assert stated == pytest.approx(0.004450713, rel=1e-4)  # as printed
    for name in ("short encounter (2-D)", "ever inside"):
        assert 4.0 / np.pi * figure(name, printed)[0] == pytest.approx(
            stated, rel=1e-3
        )  # the density is flat


def test_probability_limit(capsys):
    asked = ["encounter", "fast.cdm", "--radius", "10 m", "--limit"]
    assert main([*asked, "1e-4"]) == 1
    assert verdict(capsys.readouterr().out).startswith("not clear: collision probability 0.0034")
    assert main([*asked, "0.01"]) == 0
    assert verdict(capsys.readouterr().out).endswith("at most 0.01")


# A is the chief, B is 200 m ahead.
RATE = np.sqrt(cf.elements.EARTH_MU / 7e6**3)
KNOWN = np.diag([2.0, 5.0, 2.0, 1e-3, 1e-3, 2e-3]) ** 2
SAMPLES, EVERY, END = 3000, 40.0, 9000.0


def orbit_of(ahead, times):
    return cf.elements.inertial_from_elements(
        [[7e6, ahead + RATE * time, 0.0, 0.0, 1.0, 0.2] for time in times]
    )


@pytest.fixture
def ephemerides(desk):
    times = np.arange(0.0, END + 1.0, 60.0)
    for name, ahead, held in (
        ("A", 0.0, cf.Covariances([-300.0], [KNOWN / 4.0], ["TNW"])),
        ("B", 200.0 / 7e6, cf.Covariances([0.0, 3000.0], [KNOWN, KNOWN], ["RTN", "RTN"])),
    ):
        words = name, f"2026-001{name}", "EARTH", "GCRF", "UTC", "2026-01-01T00:00:00"
        cf.write_oem(f"{name}.oem", cf.Ephemeris(*words, times, orbit_of(ahead, times), held))
    return times


def sampled(ahead, covariance, frame, epoch, rng):
    """Return sampled positions (S, T, 3) of Kepler motion, with errors along local axes at an epoch."""
    (state,) = orbit_of(ahead, [epoch])
    position, velocity = state[:3], state[3:]
    normal = np.cross(position, velocity) / np.linalg.norm(np.cross(position, velocity))
    first = position if frame == "RTN" else velocity
    rows = np.array([first / np.linalg.norm(first), np.cross(normal, first / np.linalg.norm(first)), normal])
    drawn = rng.multivariate_normal(np.zeros(6), covariance, SAMPLES)
    elements = cf.elements.elements_from_inertial(
        np.concatenate([position + drawn[:, :3] @ rows, velocity + drawn[:, 3:] @ rows], axis=1)
    )
    times = np.arange(0.0, END + 1.0, EVERY)
    later = np.repeat(elements[:, None], len(times), axis=1)
    later[..., 1] += np.sqrt(cf.elements.EARTH_MU / later[..., 0] ** 3) * (times - epoch)
    return cf.elements.inertial_from_elements(later)[..., :3]


def sigmas_of(mean, covariance, radius):
    """Return the sigma level that keeps a ball about the origin clear, by Lagrange multipliers."""
    values, vectors = np.linalg.eigh(covariance)
    place = vectors.T @ mean

    def point(force):
        return place / (1.0 + force * values)

    force = brentq(lambda force: np.linalg.norm(point(force)) - radius, 0.0, 1e12)
    return np.sqrt(((place - point(force)) ** 2 / values).sum())


@pytest.mark.slow
def test_uncertain_ephemerides_agree_with_samples(ephemerides, capsys):
    """Probability and sigmas agree with sampled Kepler motion of both spacecraft."""
    asked = ["screen", "A.oem", "B.oem", "--hard-body", "7.5 m", "--sigmas"]
    assert main([*asked, "3"]) == 1
    printed = capsys.readouterr().out
    rng = np.random.default_rng(5)
    chief = sampled(0.0, KNOWN / 4.0, "TNW", -300.0, rng)
    apart = sampled(200.0 / 7e6, KNOWN, "RTN", 0.0, rng) - chief
    met = int((np.linalg.norm(apart, axis=2) < 15.0).any(axis=1).sum())
    row = re.search(
        rf"^A - B +{NUMBER} +{NUMBER} +[\d:.]+ +{NUMBER} +{NUMBER} to {NUMBER} +{NUMBER} +{NUMBER}$",
        printed,
        re.MULTILINE,
    )
    sigmas, time, value, low, high, start, entries = map(float, row.groups())
    truth = binomtest(met, SAMPLES).proportion_ci(0.999)
    assert truth.low < value < truth.high
    assert low <= value <= high
    assert start < 1e-100
    assert value <= entries < 1.05 * value
    spread = [
        sigmas_of(apart[:, k].mean(axis=0), np.cov(apart[:, k].T), 15.0) for k in range(100, apart.shape[1])
    ]
    assert sigmas == pytest.approx(min(spread), rel=0.05)  # error of 3000 samples
    assert time == pytest.approx(END, abs=60.0)
    assert "Covariances of 2 ephemerides, propagated by Hill's equations for up to 300.0 s (A)" in printed
    assert verdict(printed) == "1 conflict remains at 3 sigmas"
    assert main([*asked, "1"]) == 0
    assert verdict(capsys.readouterr().out) == "clear: no conflict remains at 1 sigma"


def test_missing_covariance_is_named(ephemerides, capsys):
    text = Path("A.oem").read_text()
    Path("A.oem").write_text(text[: text.index("COVARIANCE_START")])
    assert main(["screen", "A.oem", "B.oem", "--sphere", "15 m", "--sigmas", "1.5"]) in (0, 1)
    printed = capsys.readouterr().out
    assert "Covariances of 1 ephemeris\n" in printed
    assert "States taken as exact: A" in printed


def test_boxes_have_no_probability(ephemerides, capsys):
    main(["screen", "A.oem", "B.oem", "--box", "10 15 10 m", "--sigmas", "3"])
    printed = capsys.readouterr().out
    assert re.search(rf"^A - B +{NUMBER} +{NUMBER} +[\d:.]+$", printed, re.MULTILINE)
    assert "ever inside" not in printed


def test_window_without_a_pass(capsys):
    """A longer window gives more, and a short encounter needs a pass inside the window."""
    found = {}
    for window in ("1 h", "2 h"):
        assert (
            main(
                [
                    "encounter",
                    str(Path(__file__).parents[1] / "examples" / "slow_encounter.cdm"),
                    "--window",
                    window,
                ]
            )
            == 0
        )
        out = capsys.readouterr().out
        assert "give a longer --window" in out
        found[window] = float(verdict(out).split("collision probability")[-1])
        (row,) = (line.split() for line in out.splitlines() if line.startswith("short encounter (2-D)"))
        assert (row[-2] == "-") == (window == "1 h") == ("No short encounter" in out)
    assert found["2 h"] > 1.2 * found["1 h"]
