"""Gathering of lost spacecraft against an independent model, constructed orders of locks, and its laws."""

from collections import Counter
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.linalg import norm

import closeform as cf
from bodies import Body
from closeform.search.gathering.join_rule import case_number
from lost import BASIC, MODIFIED, Sky, depth, gathered
from turns import turns

RATE, LIMIT = np.radians(0.25), np.radians(25.0)
WAYS = ("second", "first", "half")


def modified(offset=0.0, reach=np.inf, half_angle=70.0):
    return cf.Search.modified(cf.Sensor(np.radians(half_angle), offset, reach), RATE, LIMIT)


def basic(half_angle, offset=0.0, reach=np.inf):
    return cf.Search.basic(cf.Sensor(np.radians(half_angle), offset, reach), RATE, LIMIT)


def drawn(seed, n, size=150.0, speed=0.06, flat=1.0):
    """Return positions and velocities of n spacecraft; a small `flat` puts them near one sun line."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-size, size, (n, 3)) * [flat, flat, 1.0], rng.uniform(-speed, speed, (n, 3))


def replay(g):
    """Yield (event, sets before, sets after) with Python sets."""
    sets = [frozenset([k]) for k in range(len(g.groups))]
    for event in g.events:
        before = sets
        if event.kind == "lock":
            mine = [s for s in sets if event.first in s or event.second in s]
            sets = [s for s in sets if s not in mine] + [frozenset().union(*mine)]
        yield event, before, sets


# ---- H03's table of joins


def chain_of_locks(order, wave):
    """Return positions in a zigzag where only neighbours lock, in `order`, and the lock times by link.

    Neighbours are 8 deg out of the plane, within a cone of 10 deg; others are steeper.
    """
    step = np.array([0.0, 0.0, 1000.0 * np.tan(np.radians(8.0))])
    half_width = np.arccos(np.cos(np.radians(10.0)) / np.cos(np.radians(8.0)))
    place, places, times = np.zeros(3), [np.zeros(3)], []
    for link, rank in enumerate(order):
        angle = np.radians(30.0 + wave * rank)  # the boresight turns from +x to -y
        along = 1000.0 * np.array([np.cos(angle), -np.sin(angle), 0.0])
        place = place + (along if link % 2 == 0 else -along) + step
        places.append(place)
        times.append((angle - half_width) / RATE)
    return np.array(places), np.array(times)


def expected_joins(links, n):
    """Return (first, second, case, joining spacecraft) per lock after H03 section IV, and the sets."""
    formation, knowledge, model = set(), [], []
    for i, j in links:
        i, j = sorted((i, j))
        sets = [next((s for s in knowledge if k in s), None) for k in (i, j)]
        kinds = [2 if k in formation else 0 if s is None else 1 for k, s in zip((i, j), sets, strict=True)]
        both = (sets[0] or {i}) | (sets[1] or {j})
        knowledge = [s for s in knowledge if s not in sets]
        burned = set()
        if 2 in kinds or not formation:
            burned = both - formation - ({i} if not formation else set())
            formation |= both
        else:
            knowledge.append(both)
        model.append((i, j, 3 * kinds[0] + kinds[1] + 1, tuple(sorted(burned))))
    assert formation | set().union(*knowledge) <= set(range(n))
    return model, [formation, *knowledge]


@pytest.mark.parametrize("n", [2, 3, 4, 5, pytest.param(6, marks=pytest.mark.slow)])
def test_chains_of_locks_join_as_in_h03(n):
    search = basic(10.0)
    rng = np.random.default_rng(n)
    cases = Counter()
    for order in permutations(range(n - 1)):
        places, times = chain_of_locks(order, 25.0)
        for given_names in {tuple(range(n)), tuple(rng.permutation(n).tolist())}:
            names = np.array(given_names)
            positions, groups = np.empty((n, 3)), np.empty(n, dtype="U1")
            positions[names] = places
            groups[names] = [("A", "B")[k % 2] for k in range(n)]
            velocities = rng.uniform(-1e-5, 1e-5, (n, 3))  # 5 mm in all
            g = cf.gather(search, positions, velocities, groups.tolist(), burns="second", rounds=1)
            ranked = np.argsort(times)
            model, sets = expected_joins([(names[k], names[k + 1]) for k in ranked], n)
            locks = [e for e in g.events if e.kind == "lock"]
            assert [(e.first, e.second, e.case) for e in locks] == [row[:3] for row in model]
            assert np.allclose(
                [e.time for e in locks], times[ranked], atol=0.01
            )  # s; 1e-5 m/s * 500 s / 1 km
            for lock, row in zip(locks, model, strict=True):
                burned = [e for e in g.events if e.kind == "burn" and e.time == lock.time]
                assert [e.first for e in burned] == list(row[3])
                assert all(e.label == 0 and e.second == -1 and e.case == 0 for e in burned)
                assert (lock.label == 0) == bool(row[3])
            assert g.ok
            assert g.sets == (tuple(range(n)),)
            assert g.lost == ()
            assert g.reason is None
            assert {frozenset(s) for s in sets} == {frozenset(range(n))}
            assert g.duration == locks[-1].time
            # all move with the lower of the first pair, which never burns
            kernel = velocities[locks[0].first]
            assert np.allclose(g.delta_v, norm(velocities - kernel, axis=1), rtol=1e-12, atol=0.0)
            cases.update(e.case for e in locks)
    reachable = {
        2: {1},
        3: {1, 3, 7},
        4: {1, 3, 6, 7, 8},
        5: {1, 2, 3, 4, 6, 7, 8},
        6: {1, 2, 3, 4, 5, 6, 7, 8},
    }
    assert set(cases) == reachable[n]  # two knowledge sets need N > 5


def test_case_numbers_of_h03():
    """H03 figure 8: rows and columns are lost, knowledge and formation."""
    lost, formation, knowledge = -1, 0, 3
    kinds = (lost, knowledge, formation)
    assert [case_number(one, other) for one in kinds for other in kinds] == list(range(1, 10))
    assert case_number(1, 7) == 5
    assert case_number(7, 0) == 6


def sees(search, t, place):
    """Return whether a pair at relative positions (T, 3), B minus A, locks at times (T,)."""
    boresight = search.boresight(t)
    q = place - 2.0 * search.sensor.offset * boresight
    size = norm(q, axis=1)
    return ((boresight * -q).sum(axis=1) <= -size * search.sensor.cosine) & (size <= search.sensor.range)


def test_locks_of_craft_that_know_each_other():
    """Cases 5 and 9 within a set, against samples of the paths every half second."""
    cases, step, search = Counter(), 0.5, basic(20.0, 7.5)
    for seed in range(4):
        g = cf.gather(search, *drawn(seed, 16), rounds=1)
        found = {(one.first, one.second): one for one in g.known_locks}
        own = {(one.first, one.second) for one in g.events if one.kind == "lock"}
        assert not own & set(found)
        for low, high in np.argwhere(np.triu(np.not_equal.outer(g.groups, g.groups))).tolist():
            begin = g.acquainted(low, high)
            if (low, high) in own or begin >= g.duration - 2 * step:
                continue
            a, b = (low, high) if g.groups[low] == "A" else (high, low)
            t = np.arange(begin + 1e-6, g.duration - step, step)
            seen = sees(g.search, t, g.paths[b].position(t) - g.paths[a].position(t))
            one, first = found.get((low, high)), t[np.argmax(seen)] if seen.any() else np.inf
            if one is None:
                assert first == np.inf
                continue
            assert begin <= one.time <= first
            after = np.array([one.time + 1e-5])
            assert sees(g.search, after, g.paths[b].position(after) - g.paths[a].position(after)).all()
            cases[one.case] += 1
        joined = [one.case for one in g.events if one.kind == "lock"]
        assert g.join_table.sum() == len(joined) + len(found)
        assert g.join_table[0, 0] == joined.count(1)
    assert cases[5] > 0 < cases[9], cases


def test_locks_at_multiples_of_a_step():
    """Against a scan of all samples."""
    search, rng = basic(60.0, 7.5), np.random.default_rng(3)
    r, v = rng.uniform(-200.0, 200.0, (400, 2, 3)), rng.uniform(-0.06, 0.06, (400, 2, 3))
    exact = cf.gather_cases(search, r, v, rounds=1)
    for step in (2.0, 45.0):
        many = cf.gather_cases(search, r, v, rounds=1, step=step)
        times = np.arange(0.0, search.duration, step)
        for case in range(400):
            place = r[case, 1] - r[case, 0] + times[:, None] * (v[case, 1] - v[case, 0])
            seen = sees(search, times, place)
            assert (many.left[case] == 0) == seen.any()
            assert not seen.any() or many.duration[case] == times[np.argmax(seen)]
        assert (exact.duration <= many.duration).all()
    with pytest.raises(ValueError, match="step: must be positive"):
        cf.gather_cases(search, r, v, step=0.0)


def test_locks_within_a_set_are_no_events():
    """The last link of a closed ring of four adds no knowledge."""
    g = cf.gather(modified(), [[0, 0, 0], [100, 0, 0], [100, 80, 0], [0, 90, 0]], np.zeros((4, 3)))
    assert [e.kind for e in g.events] == ["lock"] * 3  # no burns, because all are at rest
    assert g.ok
    assert g.delta_v.sum() == 0.0
    assert all(total == 0.0 for total in g.totals.values())


# ---- the independent model


def sparse(seed):
    """Return arguments of a slow gathering: narrow cones or short range."""
    rng = np.random.default_rng(seed)
    n = int(rng.choice([2, 3, 4, 5, 6, 7, 8, 9, 9, 9]))
    offset = float(rng.choice([0.0, 7.5]))
    reach = float(rng.choice([np.inf, 300.0]))
    plain = rng.random() < 0.6
    search = (
        basic(float(rng.choice([70.0, 40.0, 15.0, 8.0])), offset, reach) if plain else modified(offset, reach)
    )
    speed = 0.3 if offset and np.isfinite(search.near_field) and rng.random() < 0.7 else None
    size, pace = rng.choice([40.0, 150.0, 300.0, 600.0]), rng.choice([0.001, 0.02, 0.1])
    positions = rng.uniform(-size, size, (n, 3)) * ([0.05, 0.05, 1.0] if rng.random() < 0.5 else 1.0)
    velocities = rng.uniform(-pace, pace, (n, 3))
    groups = rng.permutation(["A", "B", *rng.choice(["A", "B"], n - 2)]).tolist()
    burns = str(rng.choice([*WAYS, "least"]))
    return search, positions, velocities, groups, int(rng.integers(1, 4)), burns, speed


def assert_agree(g, model, atol=1e-6):
    """Check a gathering against the model, with the promised accuracy of lock times."""
    mine = [(e.kind, e.first, e.second, e.case) for e in g.events]
    assert mine == [row[1:5] for row in model.events]
    assert np.allclose([e.time for e in g.events], [row[0] for row in model.events], rtol=0.0, atol=atol)
    for event, row in zip(g.events, model.events, strict=True):
        assert np.allclose(event.delta_v, 0.0 if row[5] is None else row[5], rtol=0.0, atol=1e-12)
    assert g.ok == model.ok
    assert set(g.lost) == model.lost
    assert {frozenset(s) for s in g.sets} == {frozenset(s) for s in model.sets}
    assert not model.sets or set(g.sets[0]) == model.sets[0]
    assert np.isclose(g.duration, model.duration, rtol=0.0, atol=atol)
    assert np.allclose(g.delta_v, model.delta_v, atol=1e-12)
    assert np.allclose(g.paths.position(g.duration), model.positions, atol=1e-5)  # 1e-6 s at up to 1 m/s
    assert np.allclose(g.paths.velocity(g.duration), model.velocities, atol=1e-12)


def test_gathering_agrees_with_an_independent_model():
    seen = Counter()
    for seed in range(100):
        search, positions, velocities, groups, rounds, burns, speed = sparse(seed)
        g = cf.gather(search, positions, velocities, groups, rounds=rounds, burns=burns, max_speed=speed)
        plain = search.legs[-1].phase == "OPS"
        wait = search.near_field / speed if speed else 0.0
        sky = Sky(BASIC if plain else MODIFIED, search.tip_angle, RATE, rounds, wait)
        model = gathered(sky, search.sensor, positions, velocities, groups, g.burns, 2.0 * (speed or 0.0))
        assert np.isclose(g.search.duration, sky.duration, rtol=1e-13)
        assert_agree(g, model)
        seen.update(model.seen)
        seen.update({f"round {g.rounds}": 1, "ok" if model.ok else "incomplete": 1})
        seen["near field"] += any(row[1] == "near field" for row in model.events)
        seen["three sets"] += len(model.sets) > 2
    # the sample contains every kind of event
    joins = ["lost-lost first", "lost-lost", "formation-lost", "knowledge-lost", "formation-knowledge"]
    others = ["knowledge-knowledge", "round 2", "round 3", "ok", "incomplete", "near field", "three sets"]
    assert not [name for name in joins + others if not seen[name]], seen


def with_errors(rng, groups, turns, longest, kind):
    """Return exaggerated `SearchErrors` and bodies with the same errors."""
    n = len(groups)
    each = {
        "pointing": rng.normal(0.0, np.radians(6.0), (n, 3)),
        "slew_rate": rng.normal(0.0, 0.03, n),
        "start": rng.normal(0.0, 90.0, n),
        "half_angle": rng.uniform(-0.3, 0.3, n) * np.radians(8.0),
        "range": np.minimum(rng.uniform(200.0, 900.0, n), longest),
        "slew_acceleration": RATE / rng.uniform(10.0, 300.0, n),
        "silent": rng.uniform(size=n) < 0.1,
    }
    given = each if kind == "all" else {kind: each[kind]}
    bodies = [
        Body(turns, group, **{name: values[k] for name, values in given.items()})
        for k, group in enumerate(groups)
    ]
    return cf.SearchErrors(**given), bodies


@pytest.mark.slow
def test_gathering_agrees_with_independently_turning_bodies():
    seen = Counter()
    kinds = [
        "all",
        "all",
        "pointing",
        "slew_rate",
        "start",
        "half_angle",
        "range",
        "slew_acceleration",
        "silent",
    ]
    for seed in range(24):
        search, positions, velocities, groups, rounds, burns, speed = sparse(seed)
        rng, kind = np.random.default_rng([7, seed]), kinds[seed % len(kinds)]
        plain = search.legs[-1].phase == "OPS"
        wait = search.near_field / speed if speed else 0.0
        turned = turns("basic" if plain else "modified", search.sensor.half_angle, search.tip_angle)
        turned = (turned + 2 * [("NFS", "wait", 0.0, wait)] * bool(wait)) * rounds
        sky = Sky(BASIC if plain else MODIFIED, search.tip_angle, RATE, rounds, wait)
        errors, bodies = with_errors(rng, groups, turned, search.sensor.range, kind)
        options = {"burns": burns, "rounds": rounds, "max_speed": speed, "errors": errors}
        g = cf.gather(search, positions, velocities, groups, **options)
        push = 2.0 * (speed or 0.0)
        model = gathered(sky, search.sensor, positions, velocities, groups, g.burns, push, bodies)
        assert_agree(g, model)
        many = cf.gather_cases(search, positions[None], velocities[None], groups, **options)
        assert many.duration[0] == g.duration
        assert np.allclose(many.each_delta_v[0], g.delta_v, rtol=1e-12, atol=0.0)
        seen.update(model.seen)
        seen.update({kind: 1, "ok" if model.ok else "incomplete": 1, f"round {g.rounds}": 1})
        seen["near field"] += len({e.time for e in g.events if e.kind == "near field"}) > 1
    joins = ["lost-lost first", "lost-lost", "formation-lost", "knowledge-lost", "formation-knowledge"]
    assert not [name for name in [*joins, "ok", "incomplete", "near field", "round 2"] if not seen[name]], (
        seen
    )


def test_two_imperfect_spacecraft_gather_at_their_lock_time():
    """Late spacecraft still turn after the end of the schedule."""
    search, n = modified(7.5, 900.0), 1500
    rng = np.random.default_rng(12)
    errors = {
        "pointing": rng.normal(0.0, np.radians(6.0), (n, 2, 3)),
        "slew_rate": rng.normal(0.0, 0.03, (n, 2)),
        "start": rng.normal(0.0, 120.0, (n, 2)),
        "silent": rng.uniform(size=(n, 2)) < 0.05,
    }
    errors["start"][:75] += 8000.0
    r, v = rng.uniform(-600.0, 600.0, (n, 2, 3)), rng.uniform(-0.1, 0.1, (n, 2, 3))
    astray = cf.SearchErrors(**errors)
    pairs = cf.lock_times(search, r[:, 1] - r[:, 0], v[:, 1] - v[:, 0], astray)
    many = cf.gather_cases(search, r, v, rounds=1, errors=astray)
    np.testing.assert_array_equal(many.left == 0, pairs.leg >= 0)
    locked = pairs.leg >= 0
    np.testing.assert_allclose(many.duration[locked], pairs.time[locked], rtol=0.0, atol=1e-6)
    assert (many.duration[locked] > search.duration).any()
    assert (~locked).sum() > 30


@pytest.mark.parametrize("speed", [None, 0.2])
def test_negligible_errors_change_nothing(speed):
    """The march through both slew profiles agrees with the one of craft that face each other."""
    rng = np.random.default_rng(13)
    r, v = rng.uniform(-250.0, 250.0, (100, 5, 3)), rng.uniform(-0.05, 0.05, (100, 5, 3))
    r[:50] *= [0.05, 0.05, 1.0]
    search, options = basic(70.0, 7.5, 250.0), {"max_speed": speed, "keep_out": cf.Sphere(20.0)}
    perfect = cf.gather_cases(search, r, v, **options)
    assert 0 < (perfect.left > 0).sum() < 100
    for errors in (cf.SearchErrors(), cf.SearchErrors(start=1e-10), cf.SearchErrors(slew_acceleration=1e9)):
        same = cf.gather_cases(search, r, v, **options, errors=errors)
        np.testing.assert_array_equal(same.leg, perfect.leg)
        np.testing.assert_array_equal(same.met_unknown, perfect.met_unknown)
        np.testing.assert_array_equal(same.met_known, perfect.met_known)
        np.testing.assert_allclose(same.duration, perfect.duration, rtol=0.0, atol=1e-6)
        np.testing.assert_allclose(same.each_delta_v, perfect.each_delta_v, rtol=0.0, atol=1e-9)


def test_errors_of_wrong_shape_are_refused():
    search, r, v = modified(), *drawn(3, 4)
    wrong = cf.SearchErrors(start=np.zeros(3))
    model = r"errors: start of 4 craft is \(N\), or common to all; got \(3,\)"
    with pytest.raises(ValueError, match=model):
        cf.gather(search, r, v, errors=wrong)
    model = r"errors: start of 4 craft in 2 cases is \(C, N\), \(N\), or common to all; got \(3,\)"
    with pytest.raises(ValueError, match=model):
        cf.gather_cases(search, np.stack([r, r]), np.stack([v, v]), errors=wrong)
    turned = cf.SearchErrors(pointing=np.zeros((3, 3)))
    with pytest.raises(ValueError, match=r"pointing of 4 craft is \(N, 3\), or common to all; got \(3, 3\)"):
        cf.gather(search, r, v, errors=turned)
    with pytest.raises(ValueError, match=r"errors: expected SearchErrors, got 0\.1"):
        cf.gather(search, r, v, errors=0.1)
    with pytest.raises(ValueError, match=r"errors: half_angle leaves 3\.9"):
        cf.gather(search, r, v, errors=cf.SearchErrors(half_angle=0.87 * np.pi))


# ---- laws


@st.composite
def gatherings(draw, largest=9):
    n = draw(st.integers(2, largest))
    search = draw(
        st.sampled_from([modified(), modified(7.5), basic(70.0, 7.5), basic(25.0), basic(40.0, 7.5, 300.0)])
    )
    size = draw(st.sampled_from([5.0, 60.0, 300.0, 3000.0]))
    pace = draw(st.sampled_from([0.0, 0.01, 0.1]))
    positions, velocities = drawn(
        draw(st.integers(0, 2**32 - 1)), n, size, pace, draw(st.sampled_from([1.0, 0.05]))
    )
    speed = 0.4 if np.isfinite(search.near_field) and draw(st.booleans()) else None
    groups = draw(st.sampled_from(["alternating", "balanced"]))
    burns = draw(st.sampled_from([*WAYS, "least"]))
    return cf.gather(search, positions, velocities, groups, burns=burns, max_speed=speed, rounds=2)


@settings(max_examples=15, deadline=None)
@given(gatherings())
def test_sets_grow_or_merge(g):
    sets = [frozenset([k]) for k in range(len(g.groups))]
    formation: frozenset[int] = frozenset()
    labels = np.full(len(g.groups), -1)
    for event, before, sets in replay(g):
        if event.kind != "lock":
            assert event.second == -1
            assert event.label == labels[event.first]
            assert event.case == 0
            continue
        assert g.groups[event.first] != g.groups[event.second]
        assert event.first < event.second
        assert all(any(old <= new for new in sets) for old in before)
        assert len(sets) == len(before) - 1
        mine = next(s for s in sets if event.first in s)
        assert event.case == case_number(labels[event.first], labels[event.second])
        labels[list(mine)] = event.label
        if event.label == 0:
            assert not formation or formation < mine
            formation = mine
        assert {frozenset(np.flatnonzero(labels == k)) for k in set(labels) - {-1}} == {
            s for s in sets if len(s) > 1
        }
    assert {frozenset(s) for s in g.sets} == {s for s in sets if len(s) > 1}
    assert {frozenset([k]) for k in g.lost} == {s for s in sets if len(s) == 1}
    assert not g.sets or frozenset(g.sets[0]) == formation
    assert g.ok == (len(formation) == len(g.groups)) == (g.status == "gathered") == (g.reason is None)
    times = [e.time for e in g.events]
    assert times == sorted(times)
    assert not g.ok or g.duration == times[-1]
    assert g.ok or g.duration == g.search.duration


@settings(max_examples=15, deadline=None)
@given(gatherings())
def test_paths_are_straight_between_burns(g):
    burned = [e for e in g.events if e.kind != "lock"]
    spent = np.zeros(len(g.groups))
    for e in burned:
        spent[e.first] += norm(e.delta_v)
        leg = g.search.legs
        assert any(k.start <= e.time <= k.end and (k.phase, k.round) == (e.phase, e.round) for k in leg)
    assert np.allclose(spent, g.delta_v, rtol=1e-12)
    assert np.isclose(spent.sum(), g.totals[g.burns], rtol=1e-12)
    for k in range(len(g.groups)):
        path = g.paths[k]
        impulses: dict[float, np.ndarray] = {}
        for e in burned:
            if e.first == k:
                impulses[e.time] = impulses.get(e.time, np.zeros(3)) + e.delta_v
        assert [t for t, _ in path.impulses] == sorted(impulses)
        for time, kick in path.impulses:
            assert np.allclose(kick, impulses[time], rtol=0.0, atol=1e-15)
        # straight lines between impulses
        r, v, clock = path.state(0.0)[:3].copy(), path.state(0.0)[3:].copy(), 0.0
        assert path.start == 0.0
        assert path.end == g.duration
        for time in sorted(impulses):
            r = r + (v * (time - clock) if time > 0.0 else 0.0)
            v, clock = v + (impulses[time] if time > 0.0 else 0.0), time
            assert np.allclose(path.position(time), r, rtol=1e-13, atol=1e-9)
        assert np.allclose(path.position(g.duration), r + v * (g.duration - clock), rtol=1e-13, atol=1e-9)


@settings(max_examples=15, deadline=None)
@given(gatherings())
def test_formation_set_keeps_its_separations(g):
    formation: set[int] = set()
    moments = [e.time for e in g.events if e.kind == "lock" and e.label == 0]
    for event, _, sets in replay(g):
        if event.kind == "lock" and event.label == 0:
            formation = set(next(s for s in sets if event.first in s))
            later = [t for t in moments if t > event.time]
            times = np.linspace(event.time, later[0] if later else g.duration, 5)
            places = np.stack([g.paths[k].position(times) for k in sorted(formation)])
            apart = places - places[:1]
            assert np.allclose(apart, apart[:, :1], rtol=0.0, atol=1e-9)  # m


@settings(max_examples=15, deadline=None)
@given(gatherings())
def test_locks_are_mutual_and_complete(g):
    sensor = g.search.sensor
    met = dict.fromkeys([(i, j) for i in range(len(g.groups)) for j in range(i)], np.inf)
    for event, _, sets in replay(g):
        if event.kind != "lock":
            continue
        for mine in sets:
            for pair in [(i, j) for i in mine for j in mine if j < i]:
                met[pair] = min(met[pair], event.time)
        looks, sensors = {}, {}
        for k in (event.first, event.second):
            looks[k] = g.search.attitude(event.time, g.groups[k])[:, 2]
            sensors[k] = g.paths[k].position(event.time) + sensor.offset * looks[k]
        for k, other in ((event.first, event.second), (event.second, event.first)):
            line = sensors[other] - sensors[k]
            angle = np.arctan2(norm(np.cross(looks[k], line)), looks[k] @ line)
            assert angle <= sensor.half_angle + 1e-6
            assert norm(line) <= sensor.range * (1.0 + 1e-9)
    # dense samples between events: spacecraft in lock are in one set
    times = np.linspace(0.0, g.duration, 1500)[:-1] + g.duration / 4001.0
    if not g.duration:
        return
    places = np.stack([g.paths[k].position(times) for k in range(len(g.groups))])
    look = g.search.boresight(times)
    for (i, j), time in met.items():
        if g.groups[i] == g.groups[j]:
            continue
        a, b = (i, j) if g.groups[i] == "A" else (j, i)
        locked = depth(sensor, places[b] - places[a], look) > 1e-9
        assert not (locked & (times < time - 1e-6)).any()


def assert_equivalent(one, other, names=None, atol=1e-6):
    names = np.arange(len(one.groups)) if names is None else np.asarray(names)
    locks = [[e for e in g.events if e.kind == "lock"] for g in (one, other)]
    assert [tuple(sorted(names[[e.first, e.second]])) for e in locks[0]] == [
        (e.first, e.second) for e in locks[1]
    ]
    assert np.allclose([e.time for e in locks[0]], [e.time for e in locks[1]], rtol=0.0, atol=atol)
    assert np.allclose(one.delta_v, other.delta_v[names], rtol=1e-9, atol=1e-12)
    assert one.ok == other.ok
    assert one.rounds == other.rounds


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.sampled_from(WAYS), st.booleans())
def test_gathering_is_independent_of_the_frame(seed, n, burns, near):
    positions, velocities = drawn(seed, n, flat=0.2)
    options = {"burns": burns, "max_speed": 0.2 if near else None}
    search = basic(70.0, 7.5)
    shift, drift = np.array([900.0, -1200.0, 400.0]), np.array([0.5, 0.2, -0.7])
    one = cf.gather(search, positions, velocities, **options)
    other = cf.gather(search, positions + shift, velocities + drift, **options)
    assert_equivalent(one, other, atol=1e-5)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.sampled_from(WAYS))
def test_point_reflection_swaps_the_groups(seed, n, burns):
    """Group B makes A's turns with the opposite boresight."""
    positions, velocities = drawn(seed, n, flat=0.2)
    groups = [("A", "B")[k % 2] for k in range(n)]
    one = cf.gather(modified(7.5), positions, velocities, groups, burns=burns)
    assume(len({e.time for e in one.events if e.kind == "lock"}) == sum(e.kind == "lock" for e in one.events))
    swapped = [{"A": "B", "B": "A"}[k] for k in groups]
    assert_equivalent(one, cf.gather(modified(7.5), -positions, -velocities, swapped, burns=burns))


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.sampled_from(WAYS))
def test_half_turn_about_the_sun_line_swaps_the_groups_in_plane(seed, n, burns):
    """Group B starts half a turn about the sun line from A; both tip about one axis in space."""
    positions, velocities = drawn(seed, n, flat=5.0)
    half_turn = np.array([-1.0, -1.0, 1.0])
    groups = [("A", "B")[k % 2] for k in range(n)]
    one = cf.gather(modified(7.5), positions, velocities, groups, burns=burns)
    assume(len({e.time for e in one.events if e.kind == "lock"}) == sum(e.kind == "lock" for e in one.events))
    assume(all(e.phase == "IPS" and e.round == 1 for e in one.events))
    swapped = [{"A": "B", "B": "A"}[k] for k in groups]
    assert_equivalent(
        one, cf.gather(modified(7.5), positions * half_turn, velocities * half_turn, swapped, burns=burns)
    )


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.randoms(use_true_random=False))
def test_order_of_spacecraft_matters_only_for_ties(seed, n, shuffle):
    positions, velocities = drawn(seed, n, flat=0.2)
    names = list(range(n))
    shuffle.shuffle(names)
    groups = np.array([("A", "B")[k % 2] for k in range(n)])
    one = cf.gather(modified(7.5), positions, velocities, groups.tolist(), burns="half")
    assume(len({e.time for e in one.events if e.kind == "lock"}) == sum(e.kind == "lock" for e in one.events))
    back = np.argsort(names)
    other = cf.gather(modified(7.5), positions[back], velocities[back], groups[back].tolist(), burns="half")
    assert_equivalent(one, other, names)


def test_gathering_scales_with_length():
    """Ten times the size, speed and offset gives the same times."""
    positions, velocities = drawn(4, 6, flat=0.3)
    model = [
        cf.gather(basic(70.0, 7.5 * k), positions * k, velocities * k, burns="half") for k in (1.0, 10.0)
    ]
    assert np.allclose([e.time for e in model[0].events], [e.time for e in model[1].events], atol=1e-7)
    assert np.allclose(model[0].delta_v * 10.0, model[1].delta_v)


# ---- ways to burn


@settings(max_examples=10, deadline=None)
@given(
    st.integers(0, 2**32 - 1), st.integers(2, 8), st.sampled_from([1.0, 0.1]), st.sampled_from([10.0, 70.0])
)
@example(1, 8, 1.0, 10.0)  # the cheapest way leaves more spacecraft than another
def test_least_chooses_the_cheapest_way_that_leaves_the_fewest(seed, n, flat, half_angle):
    positions, velocities = drawn(seed, n, 200.0, 0.1, flat)
    search = basic(half_angle, 7.5)
    flown = {way: cf.gather(search, positions, velocities, burns=way, rounds=1) for way in WAYS}
    least = cf.gather(search, positions, velocities, rounds=1)
    left = {way: n - len(g.sets[0]) if g.sets else n for way, g in flown.items()}
    assert {way: pytest.approx(g.delta_v.sum(), rel=1e-12) for way, g in flown.items()} == least.totals
    cheapest = min(g.delta_v.sum() for way, g in flown.items() if left[way] == min(left.values()))
    assert left[least.burns] == min(left.values())
    assert least.delta_v.sum() <= cheapest * (1.0 + 1e-11)
    assert np.array_equal(least.delta_v, flown[least.burns].delta_v)
    for way, g in flown.items():
        assert g.burns == way
        assert g.totals == least.totals


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from(["AB", "BA"]))
def test_two_spacecraft_spend_the_same_in_all_ways(seed, groups):
    positions, velocities = drawn(seed, 2)
    g = cf.gather(modified(), positions, velocities, list(groups))
    apart = norm(velocities[1] - velocities[0])
    assert g.ok
    assert g.burns == "second"
    assert np.allclose(list(g.totals.values()), apart, rtol=1e-12)
    assert np.allclose(g.delta_v, [0.0, apart], rtol=1e-12)
    first = cf.gather(modified(), positions, velocities, list(groups), burns="first")
    assert np.allclose(first.delta_v, [apart, 0.0], rtol=1e-12)
    half = cf.gather(modified(), positions, velocities, list(groups), burns="half")
    assert np.allclose(half.delta_v, [apart / 2.0, apart / 2.0], rtol=1e-12)
    lock = cf.lock_times(
        modified(), *((x[1] - x[0]) * (1 if groups == "AB" else -1) for x in (positions, velocities))
    )
    assert g.duration == pytest.approx(lock.time[0], abs=1e-6)


@pytest.mark.parametrize(
    ("burns", "speed"), [("first", 0.2), ("half", None), ("second", None), ("least", 0.2)]
)
def test_gather_cases_agree_with_gather(burns, speed):
    rng = np.random.default_rng(9)
    n = 5
    positions = rng.uniform(-250.0, 250.0, (16, n, 3)) * np.where(
        rng.random((16, 1, 1)) < 0.5, [0.05, 0.05, 1.0], 1.0
    )
    velocities = rng.uniform(-0.05, 0.05, (16, n, 3))
    search, keep_out = basic(70.0, 7.5, 250.0), cf.Sphere(30.0)
    options = {"burns": burns, "rounds": 2, "max_speed": speed, "keep_out": keep_out}
    many = cf.gather_cases(search, positions, velocities, "balanced", **options)
    assert len(many) == 16
    ended, burnt = set(), Counter()
    causes = {"correction": lambda one: one.corrections, "near field": lambda one: one.near_field}
    for c in range(16):
        g = cf.gather(search, positions[c], velocities[c], "balanced", **options)
        assert many.duration[c] == g.duration
        assert many.rounds[c] == g.rounds
        assert many.left[c] == (n - len(g.sets[0]) if g.sets else n)
        assert many.delta_v[c] == pytest.approx(g.delta_v.sum(), rel=1e-12)
        spent = {kind: [np.linalg.norm(e.delta_v) for e in g.events if e.kind == kind] for kind in causes}
        for kind, found in causes.items():
            assert found(many)[c] == pytest.approx(sum(spent[kind]), rel=1e-12, abs=0.0)
            burnt[kind] += len(spent[kind])
        assert (many.leg[c] >= 0) == g.ok
        if g.ok:
            leg = many.search.legs[many.leg[c]]
            assert leg.start <= g.duration <= leg.end
            assert (leg.phase, leg.round) == (g.events[-1].phase, g.events[-1].round)
        ended.add(g.ok)
    assert many.search.duration == g.search.duration
    assert ended == {True, False}
    assert (burnt["near field"] > 0) == (speed is not None)


# ---- near-field search


def test_near_field_search_finds_a_pair_along_the_sun_line():
    """The offsets hide two spacecraft within 162 m along the sun line (H03 fig. 6)."""
    search = basic(70.0, 7.5)
    assert search.near_field == pytest.approx(81.0, abs=0.5)
    for apart, hidden in ((160.0, True), (163.5, False)):
        positions = [[0.0, 0.0, 0.0], [0.0, 0.0, apart]]
        g = cf.gather(search, positions, np.zeros((2, 3)), rounds=3)
        assert g.ok != hidden
    speed = 0.2
    positions = [[0.0, 0.0, 0.0], [0.0, 0.0, 40.0]]
    g = cf.gather(search, positions, np.zeros((2, 3)), rounds=1, max_speed=speed)
    assert g.ok
    assert g.events[-1].phase == "NFS"
    burns = [e for e in g.events if e.kind == "near field"]
    wait = search.near_field / speed
    assert [e.first for e in burns] == [0, 1]
    for e in burns:
        assert e.time == pytest.approx(search.duration + wait, rel=1e-14)
        assert e.phase == "NFS"
        assert e.label == -1
        look = g.search.boresight(e.time, g.groups[e.first])
        assert np.allclose(e.delta_v, -2.0 * speed * look, rtol=0.0, atol=1e-14)
    # they part at 4 v and lock where (x - 15 m) tan(70 deg) = 40 m
    assert g.events[2].kind == "lock"
    gap = 15.0 + 40.0 / np.tan(np.radians(70.0))
    assert g.events[2].time == pytest.approx(search.duration + wait + gap / (4.0 * speed), abs=1e-6)
    legs = g.search.legs[len(search.legs) :]
    assert [leg.phase for leg in legs] == ["NFS", "NFS"]
    assert [leg.about for leg in legs] == ["none", "none"]
    assert g.search.duration == pytest.approx(search.duration + 2.0 * wait, rel=1e-14)


def test_only_lost_spacecraft_burn_in_the_near_field_search():
    """A formation, a knowledge set, and two lost spacecraft in each other's near field."""
    search = basic(70.0, 7.5, 500.0)
    positions = np.array([[0, 0, 0], [100, 0, 0], [9e3, 0, 0], [9.1e3, 0, 0], [0, 9e3, 0], [0, 9e3, 40.0]])
    g = cf.gather(search, positions, np.zeros((6, 3)), max_speed=0.5, rounds=2)
    assert [e.first for e in g.events if e.kind == "near field"] == [4, 5]
    assert g.sets == ((0, 1), (2, 3), (4, 5))
    assert not g.ok
    assert g.lost == ()
    assert "2 and 3" in g.reason
    assert "4 and 5" in g.reason
    assert "2 rounds" in g.reason
    alone = np.array([[0, 0, 0], [100, 0, 0], [0, 9e3, 0.0]])
    g = cf.gather(search, alone, np.zeros((3, 3)), max_speed=0.5, rounds=3)
    burns = [e for e in g.events if e.kind == "near field"]
    span = g.search.duration / 3.0
    wait = search.near_field / 0.5
    assert [e.first for e in burns] == [2, 2, 2]  # once a round while it is lost
    assert np.allclose([e.time for e in burns], [k * span - wait for k in (1, 2, 3)], rtol=1e-13)
    assert g.lost == (2,)
    assert "craft 2 locked with no craft" in g.reason
    assert g.rounds == 3
    # spacecraft that drift to leave the near field during the wait do not burn
    g = cf.gather(search, [[0, 0, 0], [0, 0, 60.0]], [[0, 0, 0], [0.5, 0, 0]], max_speed=0.5)
    assert not [e for e in g.events if e.kind == "near field"]
    assert g.ok


def test_no_near_field_without_an_offset():
    g = cf.gather(basic(30.0, 0.0), [[0, 0, 0], [0, 0, 50.0]], np.zeros((2, 3)), max_speed=0.2, rounds=2)
    assert all(leg.phase != "NFS" for leg in g.search.legs)
    assert not g.events
    assert g.status == "incomplete"
    assert g.lost == (0, 1)
    assert g.sets == ()
    assert g.delta_v.sum() == 0.0
    assert g.rounds == 2
    assert g.duration == g.search.duration == 2 * basic(30.0).duration


# ---- the far ends


@pytest.mark.parametrize(("size", "pace"), [(1e-6, 0.1), (1.0, 0.0), (1e7, 1e3)])
def test_extreme_sizes_and_speeds(size, pace):
    positions, velocities = drawn(7, 6, size, pace)
    for search in (modified(), modified(7.5), modified(7.5, 100.0)):
        g = cf.gather(search, positions, velocities, keep_out=cf.Sphere(20.0), max_speed=0.2)
        assert np.isfinite(g.delta_v).all()
        assert g.conflicts is not None
        assert g.ok or g.reason
        assert np.isfinite(g.paths.position(g.duration)).all()


def test_all_lock_at_the_start():
    rng = np.random.default_rng(3)
    n = 300
    positions = rng.uniform(-1.0, 1.0, (n, 3)) + np.where(np.arange(n) % 2 == 0, 0.0, 100.0)[:, None] * [
        1,
        0,
        0,
    ]
    velocities = rng.uniform(-0.1, 0.1, (n, 3))
    g = cf.gather(modified(), positions, velocities)
    assert g.ok
    assert g.duration == 0.0
    assert g.rounds == 1
    assert len(g.sets[0]) == n
    assert sum(e.kind == "lock" for e in g.events) == n - 1
    assert np.allclose(g.paths.velocity(0.0), g.paths.velocity(0.0)[0])
    assert np.array_equal(g.paths.position(0.0), positions)


def test_search_without_locks():
    positions = [[0, 0, 0], [1e4, 0, 0]]
    g = cf.gather(modified(0.0, 10.0), positions, np.zeros((2, 3)), rounds=1, keep_out=cf.Sphere(5.0))
    assert g.events == ()
    assert g.conflicts == ()
    assert g.sets == ()
    assert g.lost == (0, 1)
    assert g.reason == "craft 0 and 1 locked with no craft in 1 round"


# ---- bad input


GOOD = drawn(0, 4)


def test_invalid_input_names_the_argument():
    for name, change in [
        ("positions", {"positions": GOOD[0][:1], "velocities": GOOD[1][:1]}),
        ("positions", {"positions": GOOD[0][[0, 1, 0, 2]]}),
        ("velocities", {"velocities": GOOD[1][:3]}),
        ("groups", {"groups": ["A"] * 4}),
        ("groups", {"groups": ["A", "B", "C", "A"]}),
        ("rounds", {"rounds": 0}),
        ("rounds", {"rounds": 1.5}),
        ("burns", {"burns": "both"}),
        ("max_speed", {"max_speed": 0.0}),
        (
            "max_speed",
            {"search": cf.Search.basic(cf.Sensor(1.2, 7.5), RATE, LIMIT, tip_angle=0.1), "max_speed": 0.1},
        ),
        ("keep_out", {"keep_out": 20.0}),
    ]:
        arguments = {"search": modified(7.5), "positions": GOOD[0], "velocities": GOOD[1]} | change
        with pytest.raises(ValueError, match=f"^{name}: "):
            cf.gather(**arguments)
        several = {k: np.asarray(arguments[k])[None] for k in ("positions", "velocities")}
        with pytest.raises(ValueError, match=f"^{name}: "):
            cf.gather_cases(**(arguments | several))


def test_coincident_spacecraft_are_reported_with_their_case():
    positions = np.stack([GOOD[0], GOOD[0][[0, 1, 3, 3]]])
    with pytest.raises(ValueError, match=r"craft 2 and 3 are at the same position in case 1"):
        cf.gather_cases(modified(), positions, np.zeros((2, 4, 3)))
    with pytest.raises(ValueError, match="no cases"):
        cf.gather_cases(modified(), positions[:0], positions[:0])


@pytest.mark.parametrize(
    "zone", [cf.Sphere(20.0), cf.Box([20.0, 30.0, 15.0]), cf.Ellipsoid([30.0, 20.0, 10.0])]
)
def test_conflicts_of_cases_agree_with_gather(zone):
    """Pairs with conflicts agree with `screen` case by case."""
    draw = np.random.default_rng(3)
    positions, velocities = draw.uniform(-120, 120, (20, 7, 3)), draw.normal(size=(20, 7, 3)) * 0.05
    narrow = cf.Search.basic(cf.Sensor(np.radians(25)), np.radians(0.25), np.radians(25))  # leaves many lost
    flown = {"keep_out": zone, "rounds": 2, "burns": "second"}
    batch = cf.gather_cases(narrow, positions, velocities, **flown)
    counts = []
    for r, v in zip(positions, velocities, strict=True):
        alone = cf.gather(narrow, r, v, **flown)
        pairs = {(met.first, met.second) for met in alone.conflicts}
        starts = [(met.first, met.second, met.start) for met in alone.conflicts]
        strangers = {(i, j) for i, j, start in starts if not alone.known(i, j, start)}
        counts.append((len(strangers), len(pairs - strangers)))
    assert np.column_stack([batch.met_unknown, batch.met_known]).tolist() == [list(pair) for pair in counts]
    assert batch.met_unknown.sum() > 1
    assert not cf.gather_cases(narrow, positions, velocities).met_unknown.any()  # no zone
