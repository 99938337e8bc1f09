# ruff: noqa: E501 (messages stand as they are printed)
"""`screen --zones`: craft whose zones differ, from a file."""

import re
from pathlib import Path

import numpy as np
import pytest

from closeform.cli.app import main
from closeform.exchange.ccsds.oem import read_oem
from closeform.exchange.common_frame import common_frame
from orbit_files import oem

ZONES = """\
[craft]
name = ["A", "B"]
keep_out = [
  { covariance = "25 0 4e4 0 0 25 m^2", sigmas = 3 },
  { covariance = "9 0 1e4 0 0 9 m^2", sigmas = 3 },
]
"""


@pytest.fixture
def desk(tmp_path, monkeypatch) -> Path:
    for name, ahead in (("A", 0.0), ("B", 1e-4)):  # by 700 m
        (tmp_path / f"{name}.oem").write_text(oem(name, ahead))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    return tmp_path


def test_covariance_of_each_spacecraft(desk, capsys) -> None:
    """Compare with the distance in sigmas of the sum of both."""
    (desk / "zones.toml").write_text(ZONES)
    assert main(["screen", "A.oem", "B.oem", "--zones", "zones.toml"]) == 0
    printed = capsys.readouterr().out
    assert "Zones of pairs: covariances added, 3 sigma" in printed
    frame = common_frame([read_oem(name) for name in ("A.oem", "B.oem")])
    apart = frame.states[1, :, :3] - frame.states[0, :, :3]
    sigmas = np.sqrt((apart**2 / [34.0, 5e4, 34.0]).sum(axis=1))
    ratio = re.search(r"^A - B +(\S+) x zone", printed, re.MULTILINE)[1]
    assert 3.0 * float(ratio) == pytest.approx(sigmas.min(), rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "lines"),
    [
        ("[craft]", 'title = "x"\n[craft]', ["title: unknown key; "]),
        ('"B"', '"C"', ["craft.name: no ephemeris of C; use one of A, B", "craft.name: B is missing, which has an ephemeris; add it"]),
        ('["A", "B"]', '["B", "B"]', ["craft.name: B is given 2 times; keep one", "craft.name: A is missing, which has an ephemeris; add it"]),
        ("keep_out", "position", ["craft.keep_out: missing; add for example keep_out = { sphere = \"20 m\" }", "craft.position[1]: unknown key; use one of name, keep_out", "craft.position[2]: unknown key; use one of name, keep_out"]),
        ("4e4 0 0 25 m^2", "4e4 0 0 25 m", ['craft.keep_out[1].covariance: "25 0 4e4 0 0 25 m" is a length, not a squared length; use m^2, km^2']),
        ("sigmas = 3 },\n]", "sigmas = 2 },\n]", ["craft.keep_out: "]),
        ("[craft]", "[craft", ["line 1, column 7: [craft: not TOML: "]),
    ],
)  # fmt: skip
def test_invalid_zone_files(old: str, new: str, lines: list[str], desk, capsys) -> None:
    (desk / "zones.toml").write_text(ZONES.replace(old, new))
    assert main(["screen", "A.oem", "B.oem", "--zones", "zones.toml"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    told = printed.err.splitlines()
    assert len(told) == len(lines)
    for line, words in zip(told, lines, strict=True):
        assert line.startswith(f"zones.toml: {words}")
        assert "; " in line


def test_conflicting_zone_options(desk, capsys) -> None:
    (desk / "zones.toml").write_text(ZONES)
    for more in (["--sphere", "20 m"], ["--body"], ["--hard-body", "5 m"]):
        assert main(["screen", "A.oem", "B.oem", "--zones", "zones.toml", *more]) == 2
        words = "screen: --zones gives the zone of each craft; remove the other zone options\n"
        assert capsys.readouterr().err == words
