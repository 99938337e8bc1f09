"""`cf.plot` and `cf.animate`: every public result has a picture; other arguments are refused by name."""

import io
from dataclasses import is_dataclass
from inspect import isclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

import closeform as cf
from answers import answers
from closeform.plots.drawing.palette import CONFLICT
from closeform.plots.results import FLYING, PICTURES

# inputs, and parts of results that are drawn with the whole
GIVEN = {"Orbit", "Zone", "Box", "Ellipsoid", "Sphere", "Cylinder", "HalfSpaces", "Uncertainty", "Body"}
GIVEN |= {"PairZones", "Uncertainty", "ThrustLost", "MissedBurns", "DegradedThrust", "StuckOnThrust"}
GIVEN |= {"Thrusters", "Sensor", "Chief", "Field", "Drag", "Feedback", "Navigation"}
GIVEN |= {"SearchErrors", "CovarianceZone"}
PARTS = {
    "Contact",
    "ThrustShortfall",
    "ShadowPrice",
    "Event",
    "Leg",
    "TheoremCase",
    "ConjunctionObject",
    "Covariances",
}
PARTS |= {"Ephemeris"}  # inertial states of one object; `common_frame` makes relative ones
# one of each class; three kinds of paths
SIMILAR = {"one craft", "list of paths", "Firing of two"}


def drawn() -> list[str]:
    """Return the name of one result of each kind that is drawn."""
    found = {name.split()[-1]: name for name in answers() if name.split()[-1] not in PARTS}
    return [name for name in found.values() if name not in SIMILAR]


def pixels(figure: Figure) -> Any:
    file = io.BytesIO()
    figure.savefig(file, format="rgba", dpi=40)
    width, height = (int(40 * size) for size in figure.get_size_inches())
    return np.frombuffer(file.getvalue(), np.uint8).reshape(height, width, 4)[..., :3].astype(int)


def test_every_public_result_class_has_a_picture() -> None:
    """Every public class is drawn, or listed above as an input or a part of a result."""
    public = {name for name in cf._HOMES if isclass(getattr(cf, name)) and is_dataclass(getattr(cf, name))}
    known = FLYING.keys() | PICTURES.keys()
    assert not public - GIVEN - PARTS - known
    assert not known & (GIVEN | PARTS)
    assert known <= {type(answers()[name]).__name__ for name in drawn()} | {"Conflict"}


def test_every_result_is_drawn() -> None:
    """There are marks below the headline, which has more than a word."""
    for name in drawn():
        figure = cf.plot(answers()[name])
        assert isinstance(figure, Figure)
        seen = pixels(figure)
        assert (seen[seen.shape[0] // 5 :] < 200).any(axis=2).sum() > 130, name
        assert any(len(text.get_text()) > 8 for text in figure.texts), name


def test_conflicts_are_drawn_in_red() -> None:
    def red(figure: Figure) -> int:
        return int((np.abs(pixels(figure) - 255 * np.array(to_rgb(CONFLICT))).sum(axis=2) < 12).sum())

    assert red(cf.plot(answers()["Screening"])) >= 3  # two dots
    assert red(cf.plot(answers()["empty Screening"])) == 0


def test_screening_is_drawn_at_its_times_and_ratios() -> None:
    """Dots are at time and ratio, lines from start to end."""
    screening = answers()["Screening"]
    (axes,) = cf.plot(screening, names=["<a>", "b", "c"]).axes[:1]
    lines, dots = axes.collections
    np.testing.assert_allclose(np.sort(dots.get_offsets()[:, 1]), np.sort(screening.ratio))
    spans = np.array([segment[:, 0] for segment in lines.get_segments()])
    size = (spans[0, 1] - spans[0, 0]) / (screening.end[0] - screening.start[0])
    np.testing.assert_allclose(spans, size * np.stack([screening.start, screening.end], 1), rtol=1e-12)
    assert {text.get_text() for text in axes.texts} == {"<a> - c", "b - c"}


def test_headline_of_a_plan_counts_conflicts_with_obstacles() -> None:
    """With a zone, the headline counts conflicts before and after."""
    orbit = cf.Orbit.circular(550e3)
    rest = orbit.coast(np.zeros(6), 200.0)
    avoided = answers()["Plan of one"]
    said = cf.plot(avoided, zone=cf.Sphere(20.0), obstacles=rest).get_suptitle()
    assert "1" in said
    assert "0" in said or "no" in said.lower()


def test_failed_plan_is_refused_with_its_reason() -> None:
    blocked = cf.avoid(
        answers()["one craft"], answers()["list of paths"][1], cf.Sphere(20.0), max_acceleration=1e-9
    )
    assert not blocked.ok
    for draw in (cf.plot, lambda one: cf.animate(one, io.BytesIO())):
        with pytest.raises(ValueError, match=r"^result: the plan has no paths.*needs"):
            draw(blocked)


@pytest.mark.parametrize("bad", [None, 3, "a plan", np.ones(3), [1, 2], cf.Sphere(1.0), {"a": 1}])
def test_unsupported_objects_are_refused(bad: Any) -> None:
    for draw, known in ((cf.plot, "Screening"), (lambda one: cf.animate(one, "a.gif"), "Gathering")):
        with pytest.raises(
            TypeError, match=rf"^result: .*(cannot draw .*; give one of|has no paths; give one of): .*{known}"
        ) as caught:
            draw(bad)
        assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("name", "argument", "bad"),
    [
        ("Locks", "zone", cf.Sphere(1.0)),
        ("Locks", "names", ["a"]),
        ("Screening", "obstacles", "no path"),
        ("Path", "obstacles", 3),
        ("Path", "names", ["a"]),
        ("Path", "zone", "a ball"),
    ],
)
def test_arguments_that_do_not_apply_are_named(name: str, argument: str, bad: Any) -> None:
    with pytest.raises(ValueError, match=argument) as caught:
        cf.plot(answers()[name], **{argument: bad})
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "name", ["Path", "Plan of one", "ThrusterFiring", "Mission", "Gathering", "CommonFrame"]
)
def test_animations_show_the_motion(name: str, tmp_path: Path) -> None:
    file = tmp_path / "flight.gif"
    cf.animate(answers()[name], file, frames=2)
    frames = []
    with Image.open(file) as film:
        assert film.format == "GIF"
        assert film.n_frames >= 2
        for k in (0, film.n_frames - 1):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert (np.abs(frames[1] - frames[0]).sum(axis=2) > 60).any()


def test_animation_with_obstacles() -> None:
    file = io.BytesIO()
    rest = answers()["list of paths"][1]
    cf.animate(
        answers()["Plan of one"], file, zone=cf.Sphere(20.0), obstacles=rest, names=["mover"], frames=2
    )
    assert Image.open(file).n_frames >= 2


def test_invalid_animation_arguments_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"^file: animations are GIF, give NAME\.gif, got .*swap\.mp4$"):
        cf.animate(answers()["Path"], tmp_path / "swap.mp4")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match="file"):
        cf.animate(answers()["Path"], 3)  # type: ignore[arg-type]  # no file
    with pytest.raises(ValueError, match="frames"):
        cf.animate(answers()["Path"], io.BytesIO(), frames=1)


def test_figures_have_a_png_for_notebooks() -> None:
    """The PNG is drawn without pyplot, which would open windows."""
    figure: Any = cf.plot(answers()["Path"])  # that notebooks ask for its PNG stands in no types
    with Image.open(io.BytesIO(figure._repr_png_())) as picture:
        assert picture.format == "PNG"
        assert picture.width > 1000
