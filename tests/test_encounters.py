"""`closeform encounter` against published conjunctions."""

import re

import numpy as np
import pytest

from closeform.cli import main
from messages import FAST, MEDIUM, SLOW

NUMBER = r"(-|[-+.e\d]+)"


@pytest.fixture(autouse=True)
def desk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in (("slow", SLOW), ("medium", MEDIUM), ("fast", FAST)):
        (tmp_path / f"{name}.cdm").write_text(text)
    return tmp_path


def figure(name, printed):
    """The value of a row of the table of probabilities."""
    found = re.search(
        rf"^{re.escape(name)} .*?  +{NUMBER}  +(?:-|{NUMBER} to {NUMBER})$", printed, re.MULTILINE
    )
    return tuple(float(value) for value in found.groups() if value is not None)


def test_a_slow_conjunction_has_its_probability(capsys):
    """Alfano's case 8: CARA's Monte Carlo of 1e8 trials has it within 0.035201 to 0.035274, 95 %."""
    assert main(["encounter", "medium.cdm", "--window", "10135 s"]) == 0
    printed = capsys.readouterr().out
    value, low, high = figure("ever inside", printed)
    assert 0.035201 < value < 0.035274
    assert low <= value <= high
    assert high - low < 0.002 * value
    assert figure("short encounter (2-D)", printed)[0] < 0.97 * value  # what straight flight misses
    assert "Radius of both bodies 4 m; followed for 10135 s before and after" in printed
    assert "Warning" not in printed


def test_an_eccentric_orbit_is_warned_of(capsys):
    """Alfano's case 1, e = 0.012: CARA's Monte Carlo has 0.216865; a circle gives it to 3.5 %."""
    assert main(["encounter", "slow.cdm", "--window", "21600 s"]) == 0
    printed = capsys.readouterr().out
    assert figure("ever inside", printed)[0] == pytest.approx(0.216865, rel=0.035)
    assert figure("short encounter (2-D)", printed)[0] < 0.7 * 0.216865
    assert "Warning: the primary's eccentricity is 0.0119" in printed


def test_a_fast_conjunction_agrees_with_its_message(capsys):
    """The message's 0.004450713 is over the square about the circle of both radii: 4 / pi of it."""
    assert main(["encounter", "fast.cdm"]) == 2
    refused = capsys.readouterr().err
    assert refused.startswith("fast.cdm: tells no hard-body radius; give one: ")
    radius = re.search(r'--radius "(.*)" is what its screening excludes', refused)[1]
    assert main(["encounter", "fast.cdm", "--radius", radius]) == 0
    printed = capsys.readouterr().out
    told = figure("the message", printed)[0]
    assert told == pytest.approx(0.004450713, rel=1e-4)  # as printed
    for name in ("short encounter (2-D)", "ever inside"):
        assert 4.0 / np.pi * figure(name, printed)[0] == pytest.approx(
            told, rel=1e-3
        )  # flat across 20 m of 250 m


def test_a_probability_that_is_asked_for(capsys):
    asked = ["encounter", "fast.cdm", "--radius", "10 m", "--limit"]
    assert main([*asked, "1e-4"]) == 1
    assert capsys.readouterr().out.splitlines()[-1].startswith("not clear: collision probability 0.0034")
    assert main([*asked, "0.01"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("at most 0.01")
