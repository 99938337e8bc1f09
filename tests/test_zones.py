"""Zones as unit balls of norms with any axes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import closeform as cf

TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
COVARIANCE = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 16.0]])


def test_norm_of_a_box():
    box = cf.Box([2.0, 4.0, 8.0])
    assert box.norm([2, -4, 8]) == 1.0
    assert box.norm([1, 1, -6]) == 0.75
    np.testing.assert_array_equal(box.norm(np.zeros((3, 2, 3))), np.zeros((3, 2)))


def test_norm_of_an_ellipsoid():
    ellipsoid = cf.Ellipsoid([2.0, 4.0, 8.0])
    for tip in np.diag([2.0, -4.0, 8.0]):
        assert ellipsoid.norm(tip) == 1.0
    assert ellipsoid.norm([2, 4, 8]) == pytest.approx(np.sqrt(3), rel=1e-15)
    assert cf.Sphere(5.0).norm([3, 0, 4]) == pytest.approx(1.0, rel=1e-15)


def test_axes_are_rows_in_the_frame_of_the_path():
    """A step of one half-axis along the k-th axis of the zone ends on the surface."""
    for kind in (cf.Box, cf.Ellipsoid):
        zone = kind([2.0, 4.0, 8.0], axes=TURN)
        for axis, length in zip(TURN, [2.0, 4.0, 8.0], strict=True):
            assert zone.norm(axis * length) == pytest.approx(1.0, rel=1e-15)


def test_covariance_is_the_mahalanobis_distance():
    zone = cf.Ellipsoid.from_covariance(COVARIANCE, 3.0)
    points = np.random.Generator(np.random.Philox(1)).normal(size=(50, 3)) * 10
    distance = np.sqrt(np.einsum("ki,ij,kj->k", points, np.linalg.inv(COVARIANCE), points)) / 3
    np.testing.assert_allclose(zone.norm(points), distance, rtol=1e-12)
    np.testing.assert_allclose(zone.extents, 3 * np.sqrt(np.diag(COVARIANCE)), rtol=1e-12)


@pytest.mark.parametrize("kind", [cf.Box, cf.Ellipsoid])
def test_extents_agree_with_samples(kind):
    zone = kind([2.0, 4.0, 8.0], axes=TURN)
    points = np.random.Generator(np.random.Philox(2)).normal(size=(50_000, 3))
    surface = points / zone.norm(points)[:, None]
    widest = np.abs(surface).max(axis=0)
    assert (widest <= zone.extents * (1 + 1e-12)).all()
    assert (widest >= zone.extents * 0.98).all()  # 200 000 points come this near to a corner


def test_the_text_of_a_zone_creates_it():
    solids = (
        cf.Sphere(20.0),
        cf.Box([2, 4, 8], axes=TURN),
        cf.Ellipsoid([2, 4, 8]),
        cf.Cylinder(2, 9, [0, 3, 4]),
    )
    for zone in (*solids, cf.HalfSpaces([[1, 0, 0], [0, 3, 4]], [5, 7])):
        created = eval(repr(zone), vars(cf))
        assert created.shape == zone.shape
        assert created.norm([3, -2, 5]) == pytest.approx(zone.norm([3, -2, 5]), rel=1e-5)
    assert repr(cf.Ellipsoid.from_covariance(COVARIANCE, 3.0)).startswith("Ellipsoid([")


def test_enlarged_keeps_the_shape():
    for zone in (cf.Box([2, 4, 8], axes=TURN), cf.Ellipsoid([2, 4, 8], axes=TURN), cf.Sphere(3.0)):
        larger = zone.enlarged(1.25)
        assert larger.norm([3, -2, 5]) == pytest.approx(zone.norm([3, -2, 5]) / 1.25, rel=1e-15)
        np.testing.assert_allclose(larger.extents, zone.extents * 1.25, rtol=1e-14)


vectors = st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3).map(np.array)


@settings(deadline=None, max_examples=50)
@given(vectors, vectors, st.floats(-10, 10))
def test_zones_are_norms(a, b, factor):
    for zone in (cf.Box([2, 4, 8], TURN), cf.Ellipsoid([2, 4, 8], TURN), cf.Sphere(3.0)):
        assert zone.norm(a + b) <= (zone.norm(a) + zone.norm(b)) * (1 + 1e-12) + 1e-12
        assert zone.norm(factor * a) == pytest.approx(abs(factor) * zone.norm(a), rel=1e-12, abs=1e-12)


def test_memory_layout_of_axes_does_not_matter():
    path, other = (cf.Orbit(1e-3).coast(s, 100.0) for s in ([30.0, 0, 0, -0.6, 0, 0], np.zeros(6)))
    for kind in (cf.Box, cf.Ellipsoid):
        plain = cf.find_conflicts(path, other, kind([5.0, 9.0, 7.0], axes=TURN.copy()))
        for axes in (np.asfortranarray(TURN), TURN.T.copy().T, TURN.tolist()):
            assert cf.find_conflicts(path, other, kind([5.0, 9.0, 7.0], axes=axes)) == plain
        assert len(cf.find_conflicts(path, other, kind([5, 9, 7], axes=np.eye(3, dtype=int)))) == 1
    assert len(cf.find_conflicts(path, other, cf.Ellipsoid.from_covariance(COVARIANCE, 2.0))) == 1


BAD = {
    "zero": (lambda: cf.Box([1, 2, 0]), "half_widths: must be positive and finite"),
    "axes": (lambda: cf.Box([1, 2, 3], axes=np.ones((3, 3))), "axes: expected three orthonormal rows"),
    "no radius": (lambda: cf.Sphere(0.0), "radius: must be positive and finite"),
    "asymmetric": (
        lambda: cf.Ellipsoid.from_covariance([[1, 1, 0], [0, 1, 0], [0, 0, 1]], 1.0),
        "covariance: expected a finite symmetric",
    ),
    "indefinite": (
        lambda: cf.Ellipsoid.from_covariance(np.diag([1, 1, -1]), 1.0),
        "covariance: must be positive definite, its smallest variance is -1",
    ),
}


def test_invalid_input():
    for case in BAD:
        call, message = BAD[case]
        with pytest.raises(ValueError, match=message):
            call()
