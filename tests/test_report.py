"""Reports: every kind of stage has its section, and all formats have the same numbers."""

import re
from html import unescape
from math import nan

import pyarrow.parquet
import pytest

from closeform.campaign import campaign
from closeform.mission.mission import PLANNERS, plan_mission
from closeform.report import run
from closeform.report.description import PAIR, PHASE, Column, Table
from closeform.report.page import table as as_html
from closeform.scenario import parse
from closeform.scenario.stages import STAGES
from closeform.storage.result_folder import Folder
from runs import AFTER, FIRST, MOVING, PLACES, searched
from scenarios import GOOD

NEARER = GOOD.replace('sphere = "20 m"', 'sphere = "25 m"')  # F3 passes F2 at 21.3 m
DISTANCE = Column("distance [mm]", "distance_m", "{:.1f}".format, 1e3)
TABLE = Table(
    "Three rows",
    (PAIR, DISTANCE, Column("twice"), Column(None, "ratio"), PHASE),
    [
        (("A", "B"), 0.25, "0.5 m", 1.5, ("IPS", 1)),
        (("A", "<C>"), nan, "-", 2.5, ("OPS", 2)),
        (("B", "<C>"), None, "-", 3.5, None),
    ],
)


def test_every_kind_of_stage_runs_and_is_reported() -> None:
    kinds = set(STAGES.values())
    assert set(PLANNERS) == set(run.SECTIONS) == kinds
    assert set(campaign.KINDS) == {kind for kind in kinds if kind.searches}


def test_text_of_a_cell() -> None:
    """Numbers are scaled and rounded, absent values are dashes, columns without a heading are left out."""
    assert [column.heading for column in TABLE.shown] == ["pair", "distance [mm]", "twice", "phase"]
    assert TABLE.texts == [
        ["A - B", "250.0", "0.5 m", "IPS 1"],
        ["A - <C>", "-", "-", "OPS 2"],
        ["B - <C>", "-", "-", "-"],
    ]


def test_rows_of_zeros_are_merged() -> None:
    """They are counted without the total, and stored as they are."""
    columns = Column("craft", "craft", words=True), Column("delta-v [m/s]", "delta_v_m_s", "{:.1f}".format)
    rows = [("A", 0.0), ("B", 2.0), ("C", 0.0), ("all", 2.0)]
    table = Table("Use", columns, rows, idle="no thrust used")
    assert table.texts == [["B", "2.0"], ["2 of 3 craft: no thrust used", ""], ["all", "2.0"]]
    assert "2 of 3 craft: no thrust used" in as_html(table)
    assert table.stored == {"craft": ["A", "B", "C", "all"], "delta_v_m_s": [0.0, 2.0, 0.0, 2.0]}
    assert Table("Use", columns, rows[:2], idle="no thrust used").texts == [["A", "0.0"], ["B", "2.0"]]


def test_row_as_json() -> None:
    """Values are in SI, without columns for display only; a cell of parts is nested under its key."""
    first = {"pair": ["A", "B"], "distance_m": 0.25, "ratio": 1.5, "phase": "IPS", "round": 1}
    assert Table("", TABLE.columns, TABLE.rows[:1]).records == [first]


def test_columns_for_parquet(tmp_path) -> None:
    """Parts as columns of their own, null where there is nothing; a table without rows has columns too."""
    Folder(tmp_path).table("three", TABLE.stored)
    back = pyarrow.parquet.read_table(tmp_path / "three.parquet").to_pydict()
    assert list(back) == ["first", "second", "distance_m", "ratio", "phase", "round"]
    assert back["second"] == ["B", "<C>", "<C>"]
    assert back["distance_m"][0] == 0.25
    assert back["distance_m"][2] is None
    assert back["round"] == [1, 2, None]
    assert list(Table("", TABLE.columns, []).stored) == list(back)


def test_cells_of_the_page() -> None:
    """The same texts, escaped, words to the left."""
    html = as_html(TABLE)
    assert "<C>" not in html
    cells = [unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", html)]
    assert cells == [text for row in TABLE.texts for text in row]
    assert html.count('<td class="words">') == 2 * len(TABLE.rows)


@pytest.mark.parametrize(
    "text", [NEARER, searched(FIRST, AFTER, position=PLACES, velocity=MOVING)], ids=["move", "search"]
)
def test_every_number_of_a_file_is_in_the_summary(text: str) -> None:
    """Conflicts and spacecraft have the same numbers in Parquet files and in the summary."""
    report = run.RunReport(plan_mission(parse(text)))
    stages = report.summary["stages"]
    conflicts = report.files["conflicts"]
    told = [met for stage in stages for when in ("before", "after") for met in stage[when]["conflicts"]]
    assert bool(told) == (text == NEARER)
    for key in ("start_s", "end_s", "time_s", "ratio"):
        assert conflicts[key] == [met[key] for met in told]
    names = [list(pair) for pair in zip(conflicts["first"], conflicts["second"], strict=True)]
    assert names == [met["pair"] for met in told]
    approaches = report.files["approaches"]
    rows = list(zip(approaches["stage"], approaches["when"], approaches["ratio"], strict=True))
    for stage in stages:
        for when in ("before", "after"):
            ratios = [ratio for number, at, ratio in rows if (number, at) == (stage["number"], when)]
            assert min(ratios) == pytest.approx(stage[when]["closest"]["ratio"], abs=1e-6)
    spent = dict.fromkeys(report.summary["craft"], 0.0)
    for craft, delta_v in zip(
        report.files["craft"]["craft"], report.files["craft"]["delta_v_m_s"], strict=True
    ):
        spent[craft] += delta_v
    assert spent == pytest.approx(report.summary["delta_v_m_s"], rel=1e-12, abs=1e-15)
