"""Pictures drawn in processes of their own are those that one draws, whatever becomes of these."""

from socket import socketpair

import pytest

import closeform as cf
from closeform.report import drawing
from closeform.report.picture import Film, Picture
from closeform.storage.result_folder import Folder

ORBIT = cf.Orbit(1.1e-3)
PATH = ORBIT.coast([60, 30, 20, 0, -0.132, 0.03], 3000.0)
OTHER = ORBIT.transfer([0] * 6, [20, 0, 0, 0, 0, 0], 3000.0)
PICTURES = [
    Picture(f"{plot}-{k}", f"caption {k}", plot, (PATH, OTHER, cf.Sphere(50.0 + k)))
    for k in range(2)
    for plot in ("distances", "two_ways")
]


@pytest.fixture
def others(monkeypatch):
    """Processes that draw, which end as nobody speaks to them any more."""
    monkeypatch.setattr(drawing, "_drawers", [])
    drawing.begin()
    yield drawing._drawers
    for drawer in drawing._drawers:
        drawer.stream.close()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return draw(tmp_path_factory.mktemp("alone"))


def draw(place, pictures=PICTURES):
    """The pictures as files, and the names of those that were drawn here."""
    here = []
    leave = Picture.leave

    def heard(picture, folder, progress):
        here.append(picture.name)
        return leave(picture, folder, progress)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Picture, "leave", heard)
        found = drawing.drawn(pictures, Folder(place), lambda text: None)
    assert [shot.caption for shot in found] == [picture.caption for picture in pictures]
    assert all(shot.says for shot in found)  # what a picture says itself, for who does not see it
    return [shot.file.read_bytes() for shot in found], here


def test_others_draw_the_same_and_leave_nothing_to_this_process(tmp_path, alone, others, monkeypatch):
    monkeypatch.setattr(drawing, "HELPED", 0)  # on a machine with one core too
    assert draw(tmp_path) == (alone[0], [])


FILM = Film(
    "film", "a flight", "moving_formation.reel", ((PATH, OTHER),), {"zone": cf.Sphere(50.0), "frames": 7}
)


def film(place):
    """A film among pictures, frame by frame the same whoever draws it; and what is said meanwhile."""
    said = []
    _, shot, *_ = drawing.drawn([PICTURES[0], FILM, *PICTURES[1:]], Folder(place), said.append)
    assert shot.caption == "a flight"
    return shot.file.read_bytes(), [text for text in said if text.startswith("animation")]


@pytest.fixture(scope="module")
def film_of_one(tmp_path_factory):
    """What this process draws alone, and says."""
    return film(tmp_path_factory.mktemp("alone"))


def test_a_film_is_drawn_by_all_and_is_that_of_one(tmp_path, film_of_one, others):
    alike, told = film(tmp_path)
    assert film_of_one == (alike, [f"animation: picture {k} of 8" for k in range(1, 9)])
    assert len(told) == -(-8 // len(others))  # the first share, in which all others have as many or one less
    assert told[-1] == "animation: picture 8 of 8"


@pytest.mark.parametrize("pictures", [PICTURES, []])
def test_progress_names_pictures_and_never_counts_beyond_the_last(tmp_path, others, pictures):
    said = []
    drawing.drawn(pictures, Folder(tmp_path), said.append)
    every = {
        f"picture {k + 1} of {len(pictures)}: {one.name}" for k in range(len(pictures)) for one in pictures
    }
    assert set(said) <= every
    assert len(said) == len(pictures)


def test_one_draws_all_where_the_others_are_gone(tmp_path, alone, monkeypatch):
    ours, theirs = socketpair()
    monkeypatch.setattr(drawing, "_drawers", [drawing.Drawer(ours)])
    theirs.close()
    pictures, here = draw(tmp_path)
    assert pictures == alone[0]
    assert sorted(here) == sorted(alone[1])


@pytest.mark.parametrize("place", [0, 2])
def test_what_cannot_be_drawn_is_heard(tmp_path, others, place):
    """Each of the others ends over it, which is heard though they were one process."""
    pictures = [*PICTURES]
    pictures.insert(place, Picture("wrong", "", "distances", (PATH, OTHER, "no zone")))
    with pytest.raises(ValueError, match="zone"):
        draw(tmp_path, pictures)
