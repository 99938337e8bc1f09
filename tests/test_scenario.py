"""Scenario files: units, starts, zones, and the three format samples."""

import re
from contextlib import suppress
from itertools import permutations
from pathlib import Path
from runpy import run_path
from time import process_time

import astropy.units
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from closeform.scenario import Avoid, ScenarioError, load, parse
from closeform.scenario.quantity import (
    ANGLE,
    DURATION,
    FORCE,
    GRAVITY,
    KINDS,
    LENGTH,
    SHARE,
    TIME,
    UNITS,
    Duration,
    Kind,
    Reader,
    unit_of,
)
from closeform.scenario.study import readers
from closeform.zones.containment import containing_zone, greatest_norm
from closeform.zones.solids import Box, Cylinder, Ellipsoid, HalfSpaces, Sphere
from closeform.zones.zone import Zone
from scenarios import GOOD

EXAMPLES = Path(__file__).parents[1] / "examples"

# An independent library's view of every unit that a message offers.
ASTROPY = {
    "turn": 2 * np.pi * astropy.units.rad,
    "%": 0.01 * astropy.units.one,
    "ppm": 1e-6 * astropy.units.one,
}


def test_every_unit_is_offered_and_documented() -> None:
    """By the messages and by the page alike."""
    page = (EXAMPLES.parent / "docs" / "scenario.md").read_text()
    documented = {
        cells[0]: cells[1]
        for row in re.findall(r"^\| (.+) \|$", page, re.M)
        if (cells := row.split(" | "))[1:]
    }
    for kind in KINDS:
        known = {unit for unit, (_, dimension) in UNITS.items() if dimension == kind.dimension}
        known -= {"turns", "\u00b5N", "\u03bcN"}  # other ways to write one
        assert known <= set(kind.units)
        assert set(kind.units) == set(re.split(r",\s*", re.sub(r" \(or .*?\)", "", documented[kind.name])))
    assert set(DURATION.units) == {*TIME.units, "orbits"}


@pytest.mark.parametrize(
    ("kind", "unit", "words"),
    [(LENGTH, "deg", "an angle, not a length"), (ANGLE, "m", "a length, not an angle")],
)
def test_kinds_of_quantities_have_their_article(kind: Kind, unit: str, words: str) -> None:
    with pytest.raises(ValueError, match=f"is {words};"):
        Reader(kind).scale("1", unit)


def test_units_agree_with_astropy() -> None:
    for kind, unit in [(one, unit) for one in KINDS for unit in one.units]:
        theirs = ASTROPY[unit] if unit in ASTROPY else astropy.units.Quantity(1.0, unit.replace("^", "**"))
        metre, second, kilogram, radian = unit_of(unit)[1]
        si = f"m({metre}) s({second}) kg({kilogram}) rad({radian})"
        assert Reader(kind)(f"3 {unit}") == pytest.approx(3 * theirs.to_value(si), rel=1e-15)


@pytest.mark.parametrize(
    ("reader", "text", "value"),
    [
        (Reader(LENGTH), "500 km", 500e3),
        (Reader(LENGTH, 3), "1 -2 3e1 cm", (0.01, -0.02, 0.3)),
        (Reader(LENGTH), "  7.5\tm ", 7.5),
        (Reader(GRAVITY), "398600.4418 km^3/s^2", 3.986004418e14),
        (Reader(ANGLE), "1 turn", 2 * np.pi),
        (Reader(SHARE), "10 %", 0.1),
        (Reader(DURATION), "0.5 orbits", Duration(orbits=0.5)),
        (Reader(DURATION), "1 orbit", Duration(orbits=1.0)),
        (Reader(DURATION), "90 min", Duration(seconds=5400.0)),
    ],
)
def test_reading(reader: Reader, text: str, value: object) -> None:
    assert reader(text) == (pytest.approx(value, rel=1e-15) if not isinstance(value, Duration) else value)


@given(st.floats(-1e20, 1e20), st.sampled_from(LENGTH.units))
def test_numbers_come_through(number: float, unit: str) -> None:
    scaled = number * unit_of(unit)[0]
    if abs(scaled) >= 1e-30 or scaled == 0.0:
        assert Reader(LENGTH)(f"{number!r} {unit}") == scaled


def test_duration_on_an_orbit() -> None:
    assert Duration(orbits=0.5).on(6000.0) == pytest.approx(3000.0, rel=1e-15)
    assert Duration(seconds=12.0).on(0.0) == 12.0


def test_one_value_is_for_all_and_a_list_gives_one_each() -> None:
    scenario = parse(GOOD.replace('mass = "150 kg"', 'mass = ["150 kg", "200 kg", "250 kg"]'))
    assert scenario.names == ("F1", "F2", "F3")
    assert [craft.mass for craft in scenario.craft] == [150.0, 200.0, 250.0]
    assert [craft.velocity for craft in scenario.craft] == [(0.0, 0.0, 0.0)] * 3
    assert [craft.position for craft in scenario.craft] == [
        (0.0, 0.0, 0.0),
        (0.0, 100.0, 0.0),
        (0.0, 200.0, 0.0),
    ]


@pytest.mark.parametrize(
    ("text", "mean_motion"),
    [
        # Kepler's third law with WGS 84 constants, worked by hand
        ('altitude = "500 km"', np.sqrt(3.986004418e14 / 6878137.0**3)),
        (
            'altitude = "100 km"\nmu = "4902.8 km^3/s^2"\nradius = "1737.4 km"',
            np.sqrt(4.9028e12 / 1837400.0**3),
        ),
        ('period = "1.5 h"', 2 * np.pi / 5400.0),
        ('semi_major_axis = "7000 km"', np.sqrt(3.986004418e14 / 7e6**3)),
        ('mean_motion = "0.06 deg/s"', np.radians(0.06)),
    ],
)
def test_orbits(text: str, mean_motion: float) -> None:
    scenario = parse(GOOD.replace('altitude = "500 km"', text))
    assert scenario.orbit.build().mean_motion == pytest.approx(mean_motion, rel=1e-14)


def test_deep_space() -> None:
    text = GOOD.replace('altitude = "500 km"', "deep_space = true").replace("0.1 orbits", "30 min")
    assert parse(text).orbit.build().mean_motion == 0.0


def test_palmer_start() -> None:
    """A craft on theory (5): x = 2d - E cos, y = l + 2E sin, z = H cos at nt = 0."""
    start = 'start = { palmer = "30 40 5 7 11 13 m" }'
    text = GOOD.replace('name = ["F1", "F2", "F3"]', 'name = "F3"').replace('velocity = "0 0 0 m/s"', "")
    scenario = parse(
        text.replace('position = ["0 0 0 m", "0 100 0 m", "0 200 0 m"]', start).split("[[stage]]\nname")[0]
    )
    orbit = scenario.orbit.build()
    n = orbit.mean_motion
    expected = [10 - 30, 7 + 80, 11, 40 * n, (60 - 15) * n, 13 * n]
    np.testing.assert_allclose(scenario.craft[0].state(orbit), expected, rtol=1e-13)


COASTING = GOOD[: GOOD.index('[[stage]]\nname = "pass"')]


@pytest.mark.parametrize(
    ("text", "zone"),
    [
        ('{ sphere = "20 m" }', Sphere(20.0)),
        ('{ box = "10 20 30 m" }', Box([10.0, 20.0, 30.0])),
        ('{ ellipsoid = "10 20 30 m" }', Ellipsoid([10.0, 20.0, 30.0])),
        (
            '{ ellipsoid = "10 20 30 m", axes = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]] }',
            Ellipsoid([20.0, 10.0, 30.0]),
        ),
        (
            '{ covariance = "25 3 100 1 2 49 m^2", sigmas = 3 }',
            Ellipsoid.from_covariance([[25.0, 3.0, 1.0], [3.0, 100.0, 2.0], [1.0, 2.0, 49.0]], 3.0),
        ),
        ('{ cylinder = "10 40 m", axis = [0, 2, 0] }', Cylinder(10.0, 40.0, [0.0, 1.0, 0.0])),
        (
            '{ half_spaces = "50 20 m", normals = [[1, 1, 0], [0, -2, 0]] }',
            HalfSpaces([[1.0, 1.0, 0.0], [0.0, -1.0, 0.0]], [50.0, 20.0]),
        ),
    ],
)
def test_zones(text: str, zone: Zone) -> None:
    """The zone of the file has the norm of the zone of the API, in every direction."""
    many = f'[{text}, {{ sphere = "1 m" }}, {{ sphere = "1 m" }}]'
    keep_out = parse(COASTING.replace('{ sphere = "20 m" }', many)).craft[0].keep_out
    assert keep_out is not None
    points = np.random.default_rng(1).normal(scale=30.0, size=(100, 3))
    np.testing.assert_allclose(keep_out.zone().norm(points), zone.norm(points), rtol=1e-12)


sizes = st.tuples(*[st.floats(1.0, 100.0)] * 3)


@given(
    st.sampled_from([Box, Ellipsoid]),
    sizes,
    st.sampled_from([Box, Ellipsoid]),
    sizes,
    st.integers(0, 2**32 - 1),
)
def test_reach_is_the_greatest_norm(
    outer: type[Zone], wide: tuple[float, ...], inner: type[Zone], small: tuple[float, ...], seed: int
) -> None:
    """No sampled point of the inner zone lies further out, and some lies nearly as far."""
    random = np.random.default_rng(seed)
    turns = [np.linalg.qr(random.normal(size=(3, 3)))[0] for _ in range(2)]
    big, little = outer(wide, turns[0]), inner(small, turns[1])
    directions = random.normal(size=(20_000, 3))
    if inner is Box:  # the corners are the furthest points
        directions[:8] = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    directions = directions @ np.linalg.inv(little.matrix).T  # evenly over the zone, however long
    surface = directions / little.norm(directions)[:, None]
    found = big.norm(surface).max()
    # 20 000 random points of the unit ball's surface come within some hundredths of a radian of
    # the furthest one, and a linear image falls there like a cosine.
    assert 0.99 * greatest_norm(big, little) <= found <= greatest_norm(big, little) * (1 + 1e-12)


def test_larger_zone_of_a_pair_applies() -> None:
    text = GOOD.replace(
        'keep_out = { sphere = "20 m" }',
        'keep_out = [{ sphere = "20 m" }, { ellipsoid = "30 45 30 m" }, { sphere = "50 m" }]',
    )
    scenario = parse(text)
    held = {
        tuple(pair): zone.extents.tolist()
        for zone, pairs in scenario.zones.groups()
        for pair in pairs.tolist()
    }
    assert held == {(0, 1): [30, 45, 30], (0, 2): [50, 50, 50], (1, 2): [50, 50, 50]}
    assert [zone.extents[1] for zone in scenario.zones_around("F2")] == pytest.approx([45.0, 50.0])


def test_larger_does_not_depend_on_order() -> None:
    zones = [Sphere(10.0), Box([12.0, 12.0, 30.0]), Ellipsoid([40.0, 40.0, 60.0])]
    assert all(containing_zone(*order) is zones[2] for order in permutations(zones))
    assert containing_zone(Box([1.0, 9.0, 1.0]), Box([9.0, 1.0, 1.0])) is None


@pytest.mark.parametrize("name", sorted(file.stem for file in EXAMPLES.glob("*.toml")))
def test_samples_are_accepted(name: str) -> None:
    assert load(EXAMPLES / f"{name}.toml").title


def test_sample_values() -> None:
    tpf = load(EXAMPLES / "tpf.toml")
    assert [craft.group for craft in tpf.craft] == ["A", "B", "A", "B", "A"]
    assert tpf.craft[1].velocity == pytest.approx((-0.016, 0.069, -0.012))
    assert tpf.search is not None
    assert tpf.search.in_plane_turn == pytest.approx(2 * np.pi)
    study = load(EXAMPLES / "robustness.toml").study
    assert study is not None
    assert (study.cases, study.seed) == (150_000, 2004)
    assert set(study.vary) <= set(readers())
    assert load(EXAMPLES / "f6_scatter.toml").stages[3].durations["within"] == Duration(orbits=1.0)


def test_spacecraft_are_listed_by_the_key_that_names_them() -> None:
    fellow = 'meanwhile = [{ craft = "F1", to = { position = "0 -50 0 m", velocity = "0 0 0 m/s" } }]'
    stage = parse(GOOD + fellow).stages[1]
    assert isinstance(stage, Avoid)
    assert stage.craft_named == {"craft": ("F3",), "meanwhile[1].craft": ("F1",)}


def test_errors_name_the_file(tmp_path: Path) -> None:
    file = tmp_path / "broken.toml"
    file.write_text(GOOD.replace("closeform = 1", ""))
    with pytest.raises(ScenarioError, match="closeform") as raised:
        load(file)
    (line,) = raised.value.lines
    assert line.startswith(f"{file}: closeform: ")
    assert line.endswith("closeform = 1")


def test_reference_of_the_keys_is_up_to_date() -> None:
    """If it is not, run `python tools/scenario_keys.py > docs/scenario_keys.md`."""
    root = EXAMPLES.parent
    made = run_path(str(root / "tools" / "scenario_keys.py"))["page"]()
    assert (root / "docs" / "scenario_keys.md").read_text(encoding="utf-8") == made


@pytest.mark.parametrize("size", ['hard_body = "1e16 m"', 'keep_out = { box = "1 1 1e-10 m" }'])
def test_zone_size_out_of_range_names_the_file(size) -> None:
    key = size.partition(" ")[0]
    text = GOOD.replace('keep_out = { sphere = "20 m" }', size)
    with pytest.raises(ScenarioError, match=rf"craft.*{key}.*must be from 1e-09 to 1e\+15 m"):
        parse(text)


def test_documented_example_is_a_scenario() -> None:
    page = (EXAMPLES.parent / "docs" / "scenario.md").read_text()
    assert parse(page.split("```toml\n")[1].split("```")[0]).names == ("A", "B")


@pytest.mark.parametrize("unit", ["uN", "\u00b5N", "\u03bcN"])  # the micro sign, and the Greek letter
def test_micronewtons_with_either_character(unit):
    assert Reader(FORCE)(f"25 {unit}") == pytest.approx(25e-6, rel=1e-15)


@pytest.mark.parametrize("text", ["a" * 100_000, "\"'" * 50_000, "a. " * 40_000, " " * 100_000 + "!"])
def test_reading_time_is_linear_in_the_length(text) -> None:
    """Also of a text that is no TOML; it took minutes where it grew with the square."""
    begin = process_time()
    for written in (f"{GOOD}\n# {text}", f"{GOOD}\n{text}"):
        with suppress(ScenarioError):
            parse(written)
    assert process_time() - begin < 5.0


def test_deleted_line_of_an_example_is_reported() -> None:
    """Of one that draws for its craft: no name, so that there is no craft to draw for, is one line."""
    lines = (EXAMPLES / "s04.toml").read_text().splitlines()
    for k in range(len(lines)):
        with suppress(ScenarioError):
            parse("\n".join(lines[:k] + lines[k + 1 :]))
    text = "\n".join(line for line in lines if not line.startswith("name"))
    with pytest.raises(ScenarioError, match=r"^scenario: craft\.name: missing"):
        parse(text)
