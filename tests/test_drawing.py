"""Pictures drawn in two processes are those that one draws, whatever becomes of the second."""

import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import closeform as cf
from closeform.plots.png import png
from closeform.report import drawing
from closeform.report.picture import Picture
from closeform.result_folder import Folder

ORBIT = cf.Orbit(1.1e-3)
PATH = ORBIT.coast([60, 30, 20, 0, -0.132, 0.03], 3000.0)
OTHER = ORBIT.transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)
PICTURES = [
    Picture(f"{plot}-{k}", f"caption {k}", plot, (PATH, OTHER, cf.Sphere(50.0 + k)))
    for k in range(2)
    for plot in ("distances", "two_ways")
]


@pytest.fixture
def second(monkeypatch, request):
    """A second process with its share, that of a run unless a test asks for another."""
    monkeypatch.setattr(drawing, "_seconds", [])
    drawing.begin(getattr(request, "param", drawing.DRAWN))
    (second,) = drawing._seconds
    yield second
    second.process.kill()
    second.process.communicate()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return draw(tmp_path_factory.mktemp("alone"))


def draw(place, pictures=PICTURES):
    told = []
    found = drawing.drawn(pictures, Folder(place), told.append)
    assert [shot.caption for shot in found] == [picture.caption for picture in pictures]
    assert all(shot.says for shot in found)  # what a picture says itself, for who does not see it
    return [shot.file.read_bytes() for shot in found], len(told)


def test_the_second_process_draws_the_same(tmp_path, alone, second):
    pictures, here = draw(tmp_path)
    assert pictures == alone[0]
    assert here < alone[1] == len(PICTURES)  # some were drawn there


@pytest.mark.parametrize("second", [drawing.STUDIED._replace(alone=600.0)], indirect=True)
def test_of_a_study_the_second_process_draws_all(tmp_path, second):
    """Where this process has not loaded matplotlib, to load it takes longer than a few pictures."""
    assert draw(tmp_path)[1] == 0


def test_one_draws_all_where_the_second_is_gone(tmp_path, alone, second):
    second.process.kill()
    second.process.wait()
    assert draw(tmp_path) == alone


def test_what_cannot_be_drawn_is_heard(tmp_path, second):
    wrong = Picture("wrong", "", "distances", (PATH, OTHER, "no zone"))
    with pytest.raises(ValueError, match="zone"):
        draw(tmp_path, [*PICTURES[:1], wrong])


def test_a_png_holds_the_pixels():
    pixels = np.random.default_rng(4).integers(0, 256, (37, 53, 4), dtype=np.uint8)
    with Image.open(BytesIO(png(pixels))) as read:
        assert read.mode == "RGB"
        assert (np.asarray(read) == pixels[..., :3]).all()


def test_the_second_process_loads_no_scenarios_and_no_tables():
    code = "import sys; from closeform.report import drawing; list(map(__import__, drawing.AHEAD))"
    code += "; left = 'pydantic', 'pyarrow', 'closeform.scenario', 'scipy.spatial'"
    code += "; print([name for name in left if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "[]\n"
