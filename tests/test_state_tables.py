"""Tables of states with named columns and units."""

from pathlib import Path

import numpy as np
import pytest

import closeform as cf

GOOD = """\
# frame = GCRF
# center = EARTH
# time_system = TAI
# epoch = 2026-11-22T12:00:00
craft,note,vz [m/s],vy [m/s],vx_km_s,x_km,y [m],z_mm,time_min
A,first,3,2,0.001,7000,5,6000,0
B,other,3,2,0.001,7000,5,6000,0
A,second,3,2,0.001,7000.06,125,186000,1
B,other,3,2,0.001,7000.06,125,186000,1
A,after a burn,3,2,0.002,7000.06,125,186000,1
A,last,3,2,0.002,7000.12,245,366000,2
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "states.csv"
    file.write_text(text)
    return file


def test_columns_in_any_order_and_unit(tmp_path) -> None:
    """7000 km is 7e6 m; A has a burn after a minute."""
    before, after, other = cf.read_csv(written(tmp_path, GOOD))
    assert [one.name for one in (before, after, other)] == ["A", "A", "B"]
    told = {(one.frame, one.center, one.time_system, one.epoch) for one in (before, after, other)}
    assert told == {("GCRF", "EARTH", "TAI", "2026-11-22T12:00:00")}
    assert (before.times.tolist(), after.times.tolist()) == ([0.0, 60.0], [60.0, 120.0])
    np.testing.assert_allclose(before.states[0], [7e6, 5.0, 6.0, 1.0, 2.0, 3.0], rtol=1e-15)
    np.testing.assert_allclose(after.states[1], [7000120.0, 245.0, 366.0, 2.0, 2.0, 3.0], rtol=1e-15)


def test_single_spacecraft_needs_no_name(tmp_path) -> None:
    text = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n0,1,2,3,0,0,0\n1,1,2,3,0,0,0\n"
    (one,) = cf.read_csv(written(tmp_path, "\ufeff" + text))
    assert (one.name, one.frame, one.epoch) == ("UNKNOWN", "UNKNOWN", "UNKNOWN")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("z_mm", "z", "column 'z' has no unit; name it one of z_m, z_km, z_cm, z_mm"),
        ("y [m]", "y [ft]", "column 'y [ft]' has an unknown unit; name it one of y_m, y_km, y_cm, y_mm"),
        ("note", "x_m", "column 'x_km' occurs twice; keep one"),
        ("vz [m/s],", "dz,", "has no column of vz; add vz_m_s"),
        ("A,last,3", "A,last,three", "line 11: 'three' is not a number; correct or remove the row"),
        ("A,last,3", "A,last,nan", "line 11: a value is not finite; correct or remove the row"),
        ("A,last,3,", "A,last,", "line 11: has 8 cells for 9 columns; correct the row"),
        ("366000,2\n", "366000,0.5\n", "line 11: times of A must increase; sort the rows"),
        ("366000,2\n", "366000,1\n", "line 10: a span of one state; at least two are needed"),
    ],
)
def test_errors_are_reported_in_one_line(tmp_path, old, new, message) -> None:
    assert GOOD.count(old) == 1
    file = written(tmp_path, GOOD.replace(old, new))
    with pytest.raises(ValueError, match=r"^.*$") as error:
        cf.read_csv(file)
    assert str(error.value) == f"{file}: {message}"


@pytest.mark.parametrize("text", ["", "# frame = GCRF\n", GOOD.splitlines(True)[4]])
def test_no_rows(tmp_path, text) -> None:
    with pytest.raises(ValueError, match=r"states\.csv: has no rows; give a "):
        cf.read_csv(written(tmp_path, text))
