"""The flight core's search against the package: turns, attitudes, first locks, and whole gatherings."""

import numpy as np
import pytest

import closeform as cf
from closeform.flight.library import BUDGET, check, compiler, core, filled
from closeform.flight.search import legs_of, sensor_of

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")
RATE, LIMIT = np.radians(0.25), np.radians(25.0)


def sensor(degrees, offset=0.0, reach=np.inf):
    return cf.Sensor(np.radians(degrees), offset, reach)


SEARCHES = [  # with what the flight core makes them of: in-plane turn, tip, passes, relaxed
    (cf.Search.modified(sensor(70.0), RATE, LIMIT), None),
    (cf.Search.modified(sensor(58.0, 7.5), RATE, np.radians(45.0)), None),
    (cf.Search.modified(sensor(100.0), RATE, LIMIT), None),  # needs no tips
    (cf.Search.basic(sensor(50.0, 7.5, 800.0), RATE, LIMIT), (3.0 * np.pi, 0.0, 2, False)),
    (
        cf.Search.basic(sensor(90.0, 5.0), RATE, LIMIT, 2.0 * np.pi, 0.2, passes=3),
        (2.0 * np.pi, 0.2, 3, False),
    ),
    (cf.Search.basic(sensor(50.0), RATE, LIMIT, 2.0, passes=1, relaxed=True), (2.0, 0.0, 1, True)),
]


def schedule(half_angle, rate, limit, basic=None):
    numbers = half_angle, rate, limit, *(basic or (0.0, 0.0, 0, False))
    return core().types.new("cff_schedule_t *", numbers)


def turns(legs, count):
    return np.frombuffer(bytes(core().types.buffer(legs)), dtype=float).reshape(-1, 15)[:count]


def test_turns_are_those_of_the_package():
    types, functions = core()
    legs, count = types.new("cff_leg_t[64]"), types.new("uint32_t *")
    for search, basic in SEARCHES:
        made = functions.cff_basic_search if basic else functions.cff_modified_search
        given = schedule(search.sensor.half_angle, search.slew_rate, search.sun_limit, basic)
        check(made(given, legs, 64, count))
        assert count[0] == len(search.legs)
        expected = turns(legs_of(search), count[0])
        assert turns(legs, count[0]) == pytest.approx(expected, abs=1e-12, rel=1e-14)


def test_searches_that_cannot_be_are_refused():
    types, functions = core()
    legs, count = types.new("cff_leg_t[64]"), types.new("uint32_t *", 7)
    half = np.radians(70.0)
    narrow, full, bad = (functions.__getattr__(f"CFF_{name}") for name in ("TOO_NARROW", "FULL", "BAD_INPUT"))
    cases = [(schedule(np.radians(degrees), RATE, LIMIT), 64, narrow) for degrees in (44.0, 45.0, 60.0)]
    cases += [(schedule(half, RATE, LIMIT), 15, full)]
    cases += [
        (schedule(*numbers), 64, bad)
        for numbers in ((np.nan, RATE, LIMIT), (half, 0.0, LIMIT), (half, RATE, 1.6))
    ]
    for given, room, expected in cases:
        assert functions.cff_modified_search(given, legs, room, count) == expected
    wide_tip = schedule(half, RATE, LIMIT, (3.0, 0.5, 1, False))
    assert functions.cff_basic_search(wide_tip, legs, 64, count) == narrow
    assert count[0] == 7
    assert not turns(legs, 64).any()


def test_attitudes_are_those_of_the_package():
    types, functions = core()
    attitude = types.new("cff_attitude_t *")
    for search, _ in SEARCHES[:4]:
        legs = legs_of(search)
        for group in ("A", "B"):
            for time in np.linspace(0.0, search.duration, 50):
                check(functions.cff_attitude_at(legs, len(search.legs), time, "AB".index(group), attitude))
                axes = np.frombuffer(bytes(types.buffer(attitude)), dtype=float).reshape(3, 3).T
                assert axes == pytest.approx(search.attitude(time, group), abs=1e-13)
        for outside in (-1e-9, search.duration * 1.001, np.nan):
            assert functions.cff_attitude_at(legs, len(search.legs), outside, 0, attitude) < 0


def test_first_locks_are_those_of_the_package():
    rng = np.random.default_rng(4)
    for search, _ in SEARCHES:
        places = rng.normal(size=(1000, 3)) * 300.0
        speeds = rng.normal(size=(1000, 3)) * rng.choice([0.01, 0.1, 1.0], (1000, 1))
        mine, theirs = cf.flight.lock_times(search, places, speeds), cf.lock_times(search, places, speeds)
        assert (mine.leg == theirs.leg).all()
        assert np.nanmax(np.abs(mine.time - theirs.time)) < 1e-8


def test_a_spent_budget_says_until_when_there_is_no_lock():
    types, functions = core()
    search = SEARCHES[3][0]
    legs, lock = legs_of(search), types.new("cff_lock_t *")
    cone = sensor_of(search.sensor)
    rng = np.random.default_rng(5)
    for state in rng.normal(size=(50, 6)) * ([300.0] * 3 + [0.1] * 3):
        whole = cf.lock_times(search, state[:3], state[3:])
        since, status = 0.0, "MORE"
        while status == "MORE":
            pair = filled("cff_state_t *", state)
            found = functions.cff_first_lock(legs, len(search.legs), cone, pair, since, 3, lock)
            status = check(found, "MORE")
            assert since <= lock.certified_until_s
            assert lock.evaluations_used <= 3
            assert not whole.time[0] < lock.certified_until_s - 1e-8
            since = lock.certified_until_s
        assert lock.leg == whole.leg[0]
        assert lock.leg < 0 or lock.time_s == pytest.approx(whole.time[0], abs=1e-8)


def rows_of(vectors):
    return core().types.new("double[][3]", vectors.tolist())


def gathered_on_board(search, positions, velocities, first_burn):
    """Return the locks and burns of a gathering that the flight core runs, as rows, and the sets."""
    types, functions = core()
    gathering, join = types.new("cff_gathering_t *"), types.new("cff_join_t *")
    count = len(positions)
    check(functions.cff_gathering_begin(gathering, count, first_burn))
    start, speed = positions.copy(), velocities.copy()  # the lines at time 0
    legs, lock = legs_of(search), types.new("cff_lock_t *")
    cone = sensor_of(search.sensor)
    rows, now, held = [], 0.0, set()
    while gathering.formed < count:
        nexts = []
        for i in range(0, count, 2):  # alternating groups
            for j in range(1, count, 2):
                known = gathering.labels[i] == gathering.labels[j] != -1
                if known or (i, j) in held:
                    continue
                pair = filled("cff_state_t *", [*(start[j] - start[i]), *(speed[j] - speed[i])])
                check(functions.cff_first_lock(legs, len(search.legs), cone, pair, now, BUDGET, lock))
                if lock.leg >= 0:
                    nexts.append((lock.time_s, i, j))
        if not nexts:
            break
        now, i, j = min(nexts)
        held.add((i, j))
        check(functions.cff_gathering_lock(gathering, now, i, j, rows_of(speed), join))
        rows.append((now, "lock", *sorted((i, j)), join.table_case, join.label))
        burns = np.array([list(join.delta_v_m_s[m]) for m in range(count)])
        for m in np.flatnonzero(burns.any(axis=1)):
            rows.append((now, "burn", m, *burns[m]))
        speed = speed + burns
        start = start - burns * now
    return rows, [gathering.labels[m] for m in range(count)]


def test_gatherings_are_those_of_the_package():
    rng, cases = np.random.default_rng(6), set()
    choices = {"first": 0, "second": 1, "half": 2}
    for k in range(30):
        search = SEARCHES[0][0] if k % 3 else cf.Search.basic(sensor(20.0, 7.5), RATE, LIMIT)
        positions, velocities = rng.normal(size=(2, 16, 3)) * [[[250.0]], [[0.05]]]
        burns = [*choices][k // 3 % 3]
        expected = cf.gather(search, positions, velocities, burns=burns, rounds=1)
        rows, labels = gathered_on_board(search, positions, velocities, choices[burns])
        assert len(rows) == len(expected.events)
        for row, event in zip(rows, expected.events, strict=True):
            assert row[0] == pytest.approx(event.time, abs=1e-6)
            assert row[1] == event.kind
            assert row[2] == event.first
            if event.kind == "lock":
                assert row[3:] == (event.second, event.case, event.label)
                cases.add(event.case)
            else:
                assert row[3:] == pytest.approx(event.delta_v, abs=1e-12)
        assert labels == expected.history[-1].tolist()
    assert cases >= {1, 2, 3, 4, 5, 6, 7, 8}  # case 9 joins nothing


def test_a_lock_that_cannot_be_leaves_the_sets():
    types, functions = core()
    gathering, join = types.new("cff_gathering_t *"), types.new("cff_join_t *")
    for count, way in ((1, 0), (65, 0), (4, 3)):
        assert functions.cff_gathering_begin(gathering, count, way) < 0
    check(functions.cff_gathering_begin(gathering, 4, 0))
    speeds = np.zeros((4, 3))
    speeds[3] = np.nan  # of a lost craft, unknown
    still = rows_of(speeds)
    check(functions.cff_gathering_lock(gathering, 5.0, 0, 1, still, join))
    before = bytes(types.buffer(gathering)), bytes(types.buffer(join))
    for time, i, j in ((4.0, 0, 2), (np.nan, 0, 2), (6.0, 2, 2), (6.0, 0, 4), (6.0, 0, 3)):
        assert functions.cff_gathering_lock(gathering, time, i, j, still, join) < 0
        assert (bytes(types.buffer(gathering)), bytes(types.buffer(join))) == before
    check(functions.cff_gathering_lock(gathering, 5.0, 1, 0, still, join))
    assert join.action == functions.CFF_NOTHING_NEW
    assert join.table_case == 9
