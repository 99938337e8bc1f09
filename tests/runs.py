"""Runs of scenarios from the command line, with their output, tables and summary."""

import json
import re
from dataclasses import dataclass
from html import unescape
from pathlib import Path

import numpy as np
import pyarrow.parquet

from closeform.cli.app import main
from closeform.cli.console import WIDTH
from scenarios import LOST


@dataclass
class Run:
    status: int
    printed: str
    folder: Path

    def table(self, name: str) -> list[dict]:
        return pyarrow.parquet.read_table(self.folder / f"{name}.parquet").to_pylist()

    @property
    def summary(self) -> dict:
        return json.loads((self.folder / "summary.json").read_text())


def run_text(text: str, tmp_path: Path, monkeypatch, capsys, *, pictures: bool = False) -> Run:
    if not pictures:
        monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    (tmp_path / "case.toml").write_text(text)
    status = main(["run", str(tmp_path / "case.toml"), "--out", str(tmp_path / "results"), "--overwrite"])
    return Run(status, capsys.readouterr().out, tmp_path / "results")


def numbers(value: object) -> list[float]:
    """Return every number in a JSON value."""
    if isinstance(value, dict):
        return [n for item in value.values() for n in numbers(item)]
    if isinstance(value, list):
        return [n for item in value for n in numbers(item)]
    return [float(value)] if isinstance(value, int | float) and not isinstance(value, bool) else []


def outputs(text: str, tmp_path: Path, monkeypatch, capsys) -> tuple[int, str, dict, str]:
    """Return the status, output, summary and page of a run without pictures."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("closeform.report.page.drawn", lambda *_: ())
    Path("file.toml").write_text(text)
    status = main(["run", "file.toml", "--overwrite"])
    page = unescape(Path("file-results/report.html").read_text())
    return status, capsys.readouterr().out, json.loads(Path("file-results/summary.json").read_text()), page


AFTER = """
[[stage]]
do = "coast"
for = "100 s"
"""
FIRST = """
[[stage]]
name = "drift"
do = "coast"
for = "10 s"
"""


def searched(before: str = "", after: str = "", keep_out: str = '{ sphere = "10 m" }', **changes: str) -> str:
    """Return the scenario LOST without its study, with stages around its gathering."""
    text = LOST.split("\n[study]")[0].replace("\n[[stage]]", f"{before}\n[[stage]]", 1) + after
    text = text.replace("[craft]", f"[craft]\nkeep_out = {keep_out}")
    for key, new in changes.items():
        assert len(re.findall(rf"^{key} = .*$", text, re.MULTILINE)) == 1
        text = re.sub(rf"^{key} = .*$", f"{key} = {new}", text, flags=re.MULTILINE)
    return text


PLACES = '["0 0 0 m", "-100 0 0 m", "0 90 200 m"]'  # not in view of each other
MOVING = '["0 0 0 cm/s", "1 2 3 cm/s", "-2 1 -4 cm/s"]'
N = np.sqrt(398600.4418e9 / 6878137.0**3)  # rad/s at 500 km, Kepler
G0 = 9.80665


def plain(run: Run) -> None:
    """Check that the output has no inf or nan and fits the terminal."""
    page = re.sub(r'src="data:[^"]*"', "", (run.folder / "report.html").read_text())
    for text in (run.printed, page):
        assert not re.search(r"\b(inf|nan)\b", text)
    lines = [
        line for line in run.printed.splitlines() if "stopped in" not in line and "results in" not in line
    ]
    assert all(len(line) <= WIDTH for line in lines)
