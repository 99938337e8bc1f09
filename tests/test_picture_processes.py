"""Pictures of worker processes equal those of this process."""

import os
import signal
from dataclasses import dataclass

import pytest

import closeform as cf
from closeform.report import picture as drawing
from closeform.report.picture import Film, Picture
from closeform.storage.result_folder import Folder

ORBIT = cf.Orbit(1.1e-3)
PATH = ORBIT.coast([60, 30, 20, 0, -0.132, 0.03], 3000.0)
OTHER = ORBIT.transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)
PAIR = PATH, OTHER, cf.Sphere(50.0)
OPTIONS = {"zone": cf.Sphere(50.0), "frames": 2}
PICTURES = [
    Picture("distances", "caption 1", "distances", PAIR),
    Picture("two_ways", "caption 2", "two_ways", PAIR),
    Film("film", "in motion", "formation_animation", ((PATH, OTHER),), OPTIONS),
]


@pytest.fixture
def others(monkeypatch):
    """Let worker processes draw."""
    monkeypatch.setattr(drawing, "_begun", [True])


def files(place, pictures=PICTURES):
    """Return the drawn files and the progress messages."""
    said = []
    shots = drawing.drawn(pictures, Folder(place), said.append)
    assert [shot.caption for shot in shots] == [one.caption for one in pictures]
    assert all(shot.says for shot in shots[:2])  # the alternative text
    return [shot.file.read_bytes() for shot in shots], said


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Return the files that one process draws."""
    found, said = files(tmp_path_factory.mktemp("alone"))
    assert f"picture {len(PICTURES)} of {len(PICTURES)}: film" in said
    return found


def test_parallel_processes_draw_the_same_pictures(tmp_path, alone, others):
    found, said = files(tmp_path)
    assert found == alone
    assert said


@dataclass(frozen=True)
class Killer(Picture):
    """Picture that ends the process that draws it, unless this is the process `spared`."""

    spared: int = 0

    def draw(self, folder):
        if os.getpid() != self.spared:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().draw(folder)


def test_pictures_are_drawn_if_a_worker_is_killed(tmp_path, alone, others):
    killer = Killer("distances", "caption 1", "distances", PAIR, spared=os.getpid())
    assert files(tmp_path, [killer, *PICTURES[1:]])[0] == alone


def test_drawing_errors_are_raised(tmp_path, others):
    wrong = Picture("wrong", "", "distances", (PATH, OTHER, "no zone"))
    with pytest.raises(ValueError, match="zone"):
        drawing.drawn([*PICTURES, wrong], Folder(tmp_path), lambda text: None)
