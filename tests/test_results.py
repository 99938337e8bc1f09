"""Results as text with units, as tables in notebooks, as columns of data frames, and pickled."""

import copy
import multiprocessing
import pickle
import re
from base64 import b64decode
from dataclasses import fields, is_dataclass
from html import unescape
from html.parser import HTMLParser
from io import BytesIO
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image

import closeform as cf
from answers import answers
from closeform.result import Result, Rows

SEVERAL = "list of paths", "conflicts", "no conflicts"
UNITS = re.compile(r"_(s|m|m_s|m_s2|m2_s3|kg|1_s)$")


def single() -> list[str]:
    """Return the names of single results."""
    return [name for name in answers() if name not in SEVERAL]


def tables() -> list[str]:
    """Return the names of results with columns."""
    return [name for name, one in answers().items() if hasattr(one, "columns")]


class Cells(HTMLParser):
    """The text of each cell; tags that are opened are closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        assert tag in {"table", "caption", "thead", "tbody", "tr", "th", "td", "img", "iframe"}
        self.open.append(tag)
        if tag in ("th", "td"):
            self.cells.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1] in ("th", "td"):
            self.cells[-1] += data


def test_every_result_has_text_and_tables_have_columns() -> None:
    silent = {name for name, one in answers().items() if not isinstance(one, Result)}
    assert silent == {*SEVERAL}
    assert {name for name, one in answers().items() if isinstance(one, Rows)} <= {*tables()}
    assert {"Screening", "Simulation", "CommonFrame"} <= {*tables()}


def test_text_of_a_result_is_short() -> None:
    for name in single():
        said = repr(answers()[name])
        assert said.startswith(f"<{type(answers()[name]).__name__}: ")
        lines = said.splitlines()
        assert len(lines) <= 8
        assert all(len(line) <= 100 for line in lines)
        assert "array(" not in said
        assert " at 0x" not in said


def test_text_of_a_result_states_units() -> None:
    assert re.search(r"start \d\S* s; end \d\S* s; time \d\S* s; ratio 0\S*>", repr(answers()["Conflict"]))
    assert "energy " + f"{answers()['Plan'].energy:.6g} m²/s³" in " ".join(repr(answers()["Plan"]).split())
    assert "distance 10.9545 m" in repr(answers()["Approach"])
    by_delta_v = answers()["Plan for delta-v"]
    assert f"lower bound {by_delta_v.lower_bound:.6g} m/s;" in " ".join(repr(by_delta_v).split())
    assert "6 craft of shape (2, 3)" in repr(answers()["batch of two axes"])


def test_notebook_shows_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """All text is in well-formed HTML; test_plot_any_result.py draws the picture of every result."""
    monkeypatch.setattr(Result, "_figure", lambda _: "")
    for name in single():
        cells = Cells(answers()[name]._repr_html_()).cells
        assert len(cells) >= 2
        assert not any(" at 0x" in cell for cell in cells)


def test_notebook_shows_a_picture() -> None:
    """PNG images of results that can be drawn, and the interactive page of a mission."""
    found = re.search(r'src="data:image/png;base64,([^"]+)"', answers()["Screening"]._repr_html_())
    assert found
    assert Image.open(BytesIO(b64decode(found[1]))).size[0] > 300
    page = re.search(r'<iframe [^>]*srcdoc="([^"]+)"', answers()["Mission"]._repr_html_())
    assert page
    assert unescape(page[1]).startswith("<!doctype html>")


def test_notebook_escapes_names() -> None:
    """Titles and names of a scenario are escaped."""
    mission = answers()["Mission"]
    html = mission._repr_html_()
    assert "Ends <b>at once</b>" in Cells(html).cells
    assert "<b>" not in html


def test_columns_make_a_data_frame() -> None:
    """Columns have equal lengths, one axis and units in their names; pyarrow returns the same values."""
    for name in tables():
        columns = answers()[name].columns()
        assert len({np.shape(values) for values in columns.values()}) == 1
        assert all(np.ndim(values) == 1 for values in columns.values())
        table = pa.table(columns)
        assert table.column_names == list(columns)
        for key, values in columns.items():
            np.testing.assert_array_equal(table[key].to_numpy(), values)
        for key, values in columns.items():
            if np.asarray(values).dtype.kind == "f":
                unitless = ("ratio", "lower", "sigmas", "factor", "radial", "along_track", "cross_track")
                assert UNITS.search(key) or key in unitless


def test_columns_equal_the_attributes() -> None:
    screening, near = answers()["Screening"], answers()["batch Approach"]
    columns = screening.columns()
    assert list(columns) == ["first", "second", "start_s", "end_s", "time_s", "ratio"]
    rows = [(one.first, one.second, one.start, one.end, one.time, one.ratio) for one in screening.conflicts]
    assert list(zip(*(values.tolist() for values in columns.values()), strict=True)) == rows
    assert near.columns()["ratio"].tolist() == near.ratio.ravel().tolist()
    events, gathered = answers()["Gathering"].columns(), answers()["Gathering"]
    assert events["time_s"].tolist() == [event.time for event in gathered.events]
    np.testing.assert_array_equal(events["dvy_m_s"][1], gathered.events[1].delta_v[1])
    frame = answers()["CommonFrame"]
    assert frame.columns()["name"].tolist() == ["A", "A", "B", "B"]
    np.testing.assert_array_equal(frame.columns()["vz_m_s"][2:], frame.states[1, :, 5])
    pulses = answers()["Pulses"]
    np.testing.assert_array_equal(pulses.columns()["cross_track"], pulses.direction[:, 2])


def test_columns_of_two_failing_spacecraft() -> None:
    orbit = cf.Orbit.circular(550e3)
    moves = orbit.transfer([[0, 90.0, 0, 0, 0, 0]], [[0, 60.0, 0, 0, 0, 0]], 200.0)
    other = orbit.transfer(np.zeros(6), [0, -20.0, 0, 0, 0, 0], 200.0)
    both = cf.drift_approach(moves, other, cf.Sphere(10.0), 200.0, failing="both").columns()
    assert {"failed_at_s", "other_failed_at_s"} <= both.keys()
    assert {np.shape(values) for values in both.values()} == {(1,)}


def same(one: Any, other: Any) -> None:
    """Equal, number by number."""
    assert type(one) is type(other)
    if is_dataclass(one) and not isinstance(one, type):
        for field in fields(one):
            same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, tuple | list):
        assert len(one) == len(other)
        for each, twin in zip(one, other, strict=True):
            same(each, twin)
    elif isinstance(one, float):
        assert one == other or (one != one and other != other)


def test_results_pickle_and_copy() -> None:
    for name in single():
        answer = answers()[name]
        for twin in (pickle.loads(pickle.dumps(answer)), copy.copy(answer), copy.deepcopy(answer)):
            same(answer, twin)


def test_unpickled_results_work() -> None:
    path, search = (pickle.loads(pickle.dumps(answers()[name])) for name in ("Path", "Search"))
    np.testing.assert_array_equal(path.state(150.0), answers()["Path"].state(150.0))
    assert len(search.legs) == len(answers()["Search"].legs)
    zones = [cf.Box([1.0, 2, 3]), cf.Cylinder(2.0, 5.0, [0, 1, 0]), cf.PairZones.of([cf.Sphere(20.0)] * 3)]
    box, drum, pairs = pickle.loads(pickle.dumps(zones))
    assert box.norm([0.5, 0, 0]) == zones[0].norm([0.5, 0, 0])
    assert drum.norm([0.5, 0, 0]) == zones[1].norm([0.5, 0, 0])
    assert len(cf.screen(path, pairs)) == len(answers()["Screening"])


def state_of(path: cf.Path) -> Any:
    return path.state(100.0)


def test_paths_pass_between_processes() -> None:
    """A spawned process evaluates a path."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        (there,) = pool.map(state_of, [answers()["Path"]])
    np.testing.assert_array_equal(there, answers()["Path"].state(100.0))


def test_a_mission_has_paths_conflicts_and_burns() -> None:
    mission = answers()["Mission"]
    assert mission.paths.shape == (2,)
    np.testing.assert_array_equal(mission.paths.state(10.0), mission.results[0].after.paths.state(10.0))
    assert list(mission.conflicts) == ["stage", "first", "second", "start_s", "end_s", "time_s", "ratio"]
    assert {len(values) for values in mission.burns.values()} == {0}
