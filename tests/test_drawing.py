"""Pictures drawn by other processes equal those that this process draws."""

import os
import signal
from concurrent.futures import ProcessPoolExecutor

import pytest

import closeform as cf
from closeform.report import picture as drawing
from closeform.report.picture import Film, Picture
from closeform.storage.result_folder import Folder

ORBIT = cf.Orbit(1.1e-3)
PATH = ORBIT.coast([60, 30, 20, 0, -0.132, 0.03], 3000.0)
OTHER = ORBIT.transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)
PICTURES = [
    *(
        Picture(plot, f"caption of {plot}", plot, (PATH, OTHER, cf.Sphere(50.0)))
        for plot in ("distances", "two_ways")
    ),
    Film(
        "film", "in motion", "moving_formation.reel", ((PATH, OTHER),), {"zone": cf.Sphere(50.0), "frames": 7}
    ),
]


@pytest.fixture
def pool(monkeypatch):
    """The processes that `begin` starts."""
    monkeypatch.setattr(drawing, "_pools", [])
    drawing.begin()
    yield drawing._pools[0]
    drawing._pools[0].shutdown(cancel_futures=True)


def files(place, pictures=PICTURES):
    """Return the drawn files and the progress messages."""
    said = []
    shots = drawing.drawn(pictures, Folder(place), said.append)
    assert [shot.caption for shot in shots] == [one.caption for one in pictures]
    assert all(shot.says for shot in shots[:2])  # the alternative text
    return [shot.file.read_bytes() for shot in shots], said


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """The files that one process draws."""
    found, said = files(tmp_path_factory.mktemp("alone"))
    assert len(said) == len(PICTURES)
    return found


def test_processes_draw_the_same_pictures(tmp_path, alone, pool):
    found, said = files(tmp_path)
    assert found == alone
    assert said


def test_this_process_draws_if_another_is_killed(tmp_path, alone, pool):
    pool.submit(os.kill, pool.submit(os.getpid).result(), signal.SIGKILL)
    assert files(tmp_path)[0] == alone


def test_an_error_of_a_picture_is_raised(tmp_path, pool):
    wrong = Picture("wrong", "", "distances", (PATH, OTHER, "no zone"))
    with pytest.raises(ValueError, match="zone"):
        drawing.drawn([*PICTURES, wrong], Folder(tmp_path), lambda text: None)
    assert isinstance(pool, ProcessPoolExecutor)
