"""Proofs that all pairs of a box lock, against sampled states and errors and 50 digits."""

from math import cos, inf, radians

import mpmath
import numpy as np
import pytest

import closeform as cf
from bodies import Body, first_lock
from closeform.search.proofs.error_bounds import ErrorBounds, instants_of
from turns import Turning, turns

RATE, LIMIT = radians(0.25), radians(25)
S04 = cf.Search.modified(cf.Sensor(radians(70)), RATE, LIMIT)
DRAWN = np.array([1000.0, 1000.0, 1000.0, 0.4, 0.4, 0.4])  # S04's draws, B less A, each way
COUNTEREXAMPLE = np.array([2.08, 25.2, -305.6, 0.0, 0.0, 0.0831])  # S04 section V
FIRST_ROUND = 4283.0  # s, when the first mOPS ends


def generator(seed):
    return np.random.Generator(np.random.Philox(seed))


def inside(low, high, count, seed):
    return generator(seed).uniform(low, high, (count, 6))


def is_decided(proof, states):
    """Return which states lie in no undecided box."""
    out = np.ones(len(states), dtype=bool)
    for low, high in proof.undecided:
        out &= ~((states >= low) & (states <= high)).all(axis=1)
    return out


def onto_faces(states):
    """Scale states onto the faces of S04's box."""
    return states / np.abs(states / DRAWN).max(axis=1)[:, None]


def tilted(boresights, errors):
    """Return boresights turned by small rotation vectors, all (T, 3)."""
    angle = np.linalg.norm(errors, axis=-1, keepdims=True)
    axis = errors / np.where(angle > 0.0, angle, 1.0)
    along = (axis * boresights).sum(-1, keepdims=True)
    turned = boresights * np.cos(angle) + np.cross(axis, boresights) * np.sin(angle)
    return turned + axis * along * (1.0 - np.cos(angle))


def test_proven_states_lock_with_any_errors():
    """Proven states lock with the largest errors of rate, timing and, at every look, pointing."""
    pointing, late, pace = radians(1.0), 3.0, 1e-3
    bounds = {"pointing_error": pointing, "timing_error": late, "rate_error": pace}
    proof = cf.prove_locks(S04, -DRAWN, DRAWN, **bounds, nodes=3000)
    assert 0.9 < proof.proven < 1.0
    states = inside(-DRAWN, DRAWN, 160, 1)
    states = states[is_decided(proof, onto_faces(states))]
    assert len(states) > 130
    sides = [Turning(turns("modified", radians(70)), RATE, group) for group in "AB"]
    times = instants_of(S04, S04.duration, ErrorBounds())[:, 0]
    seen = np.zeros((len(states), len(times)), dtype=bool)
    draw = generator(2)
    for some in np.array_split(np.arange(len(states)), 20):
        sign = draw.choice([-1.0, 1.0], 4)
        clocks = [(times + r * late) * (1 + s * pace) for s, r in (sign[:2], sign[2:])]
        look = [
            side.boresight(np.clip(clock, 0.0, side.ends[-1]))
            for side, clock in zip(sides, clocks, strict=True)
        ]
        for k in some:
            both = np.ones(len(times), dtype=bool)
            away = states[k, :3] + times[:, None] * states[k, 3:]
            for boresight, line in zip(look, (away, -away), strict=True):
                lean = np.cross(line, boresight)  # away from the other, or at random
                lean = lean if k % 2 else draw.normal(size=lean.shape)
                lean *= pointing / np.linalg.norm(lean, axis=1, keepdims=True)
                b = tilted(boresight, lean)
                both &= (b * line).sum(1) >= cos(radians(70)) * np.linalg.norm(line, axis=1)
            seen[k] = both
    assert seen.any(axis=1).all()


def test_faces_represent_all_multiples():
    """States of S04's whole box lock if their multiples on the faces are proven."""
    proof = cf.prove_locks(S04, -DRAWN, DRAWN, pointing_error=radians(4), nodes=2000)
    narrow = cf.Search(cf.Sensor(radians(66)), S04.slew_rate, S04.sun_limit, S04.tip_angle, S04.legs)
    states = inside(-DRAWN, DRAWN, 200_000, 3)
    never = states[cf.lock_times(narrow, states[:, :3], states[:, 3:]).leg < 0]
    assert len(never) > 3
    assert not is_decided(proof, onto_faces(never)).any()
    assert len(never) / len(states) <= proof.open


@pytest.mark.slow
def test_almost_all_of_s04s_box_is_proven():
    """The undecided share shrinks with the number of boxes."""
    less, more = (cf.prove_locks(S04, -DRAWN, DRAWN, nodes=count) for count in (20_000, 120_000))
    assert more.open < 1e-7 < less.open < 1e-3
    assert not len(more.counterexamples)
    volume = (more.undecided[:, 1] - more.undecided[:, 0]) / (2 * DRAWN)
    assert more.open == pytest.approx(np.where(volume > 0.0, volume, 1.0).prod(axis=1).sum() / 12)


def test_margins_agree_with_proofs():
    """No undecided box meets a set that locks by `lock_margins`."""
    draw = generator(4).uniform(-1.0, 1.0, (2, 40, 6)) * DRAWN / 2
    pairs = draw[0] - draw[1]
    late = pairs[cf.lock_times(S04, pairs[:, :3], pairs[:, 3:]).time > 100.0][1:2]
    for pair in late:
        ball = cf.lock_margins(S04, pair[:3], pair[3:])
        reach = np.repeat([ball.position, ball.velocity], 3)
        proof = cf.prove_locks(S04, pair - reach, pair + reach, nodes=90_000)
        off = np.maximum(0.0, np.maximum(proof.undecided[:, 0] - pair, pair - proof.undecided[:, 1]))
        far = np.linalg.norm(off[:, :3], axis=1) / ball.position
        far += np.linalg.norm(off[:, 3:], axis=1) / ball.velocity
        assert (far > 1.0).all()
        error = 0.5 * ball.depth
        held = cf.prove_locks(S04, pair - 0.1 * reach, pair + 0.1 * reach, pointing_error=error, nodes=1000)
        assert held.ok


def test_single_round_has_counterexamples():
    """Counterexamples to a single round exist near S04's and in its whole box."""
    reach = np.array([0.1, 0.1, 0.1, 1e-5, 1e-5, 1e-5])
    near = cf.prove_locks(S04, COUNTEREXAMPLE - reach, COUNTEREXAMPLE + reach, latest=FIRST_ROUND, nodes=99)
    assert near.proven == 0.0
    assert cf.prove_locks(S04, COUNTEREXAMPLE - reach, COUNTEREXAMPLE + reach).ok
    far = cf.prove_locks(S04, -DRAWN, DRAWN, latest=FIRST_ROUND, nodes=20_000)
    assert not far.ok
    for proof in (near, far):
        states = proof.counterexamples
        assert len(states) > 0
        found = cf.lock_times(S04, states[:, :3], states[:, 3:])
        assert (found.time > FIRST_ROUND).all()


@pytest.mark.parametrize(
    ("degrees", "nodes"), [pytest.param(0.5, 200_000, marks=pytest.mark.slow), (2.0, 20_000)]
)
def test_counterexamples_of_pointing_errors_never_lock(degrees, nodes):
    """Dense sampling of the papers' turns confirms counterexamples; for 2 deg some are at rest."""
    proof = cf.prove_locks(S04, -DRAWN, DRAWN, pointing_error=radians(degrees), nodes=nodes)
    assert len(proof.counterexamples)
    turning = Turning(turns("modified", radians(70)), RATE)
    times, looks = turning.samples(2.0)
    for state in proof.counterexamples[:: max(1, len(proof.counterexamples) // 50)]:
        line = state[:3] + times[:, None] * state[3:]
        angle = np.arccos((looks * line).sum(1) / np.linalg.norm(line, axis=1))
        assert angle.min() > radians(70 - degrees)
    still = (proof.counterexamples[:, 3:] == 0.0).all(axis=1)
    assert still.any() == (degrees == 2.0)


def lock_of_bodies(state, errors):
    """Return the lock time of two independently turning bodies with errors, by dense sampling."""
    plan = turns("modified", radians(70))
    one, other = (
        Body(plan, group, **{name: values[side] for name, values in errors.items()})
        for side, group in enumerate("AB")
    )
    return first_lock(one, other, S04.sensor, state[:3], state[3:])


def assert_never_lock(proof):
    names = "half_angle", "slew_rate", "start", "slew_acceleration"
    for k, state in enumerate(proof.counterexamples[:3]):
        assert np.isnan(lock_of_bodies(state, {name: getattr(proof.errors, name)[k] for name in names}))


BOUNDS = [
    {"timing_error": 5.0},
    {"rate_error": 2e-3},
    {"slew_acceleration": radians(0.1)},
    {"pointing_error": radians(0.5), "timing_error": 2.0, "rate_error": 1e-3},
    {
        "pointing_error": radians(1),
        "timing_error": 3.0,
        "rate_error": 5e-4,
        "slew_acceleration": radians(0.5),
    },
]


@pytest.mark.parametrize(
    "bounds", [*(pytest.param(one, marks=pytest.mark.slow) for one in BOUNDS[:4]), BOUNDS[4]]
)
def test_counterexamples_of_all_errors_never_lock(bounds):
    """The certified search and sampled bodies confirm counterexamples within the bounds."""
    proof = cf.prove_locks(S04, -DRAWN, DRAWN, **bounds, nodes=20_000)
    states, errors = proof.counterexamples, proof.errors
    assert len(states) > 0
    assert errors.shape == (len(states), 2)
    assert (cf.lock_times(S04, states[:, :3], states[:, 3:], errors).leg == -1).all()
    assert (abs(errors.start) <= bounds.get("timing_error", 0.0)).all()
    assert (abs(errors.slew_rate) <= bounds.get("rate_error", 0.0)).all()
    assert (-errors.half_angle <= bounds.get("pointing_error", 0.0)).all()
    assert (errors.slew_acceleration >= bounds.get("slew_acceleration", inf)).all()
    assert not is_decided(proof, onto_faces(states)).any()
    assert_never_lock(proof)


@pytest.mark.parametrize("bounds", BOUNDS[-1:])
def test_proven_states_lock_with_sampled_errors(bounds):
    """Proven pairs lock with random errors within the bounds."""
    proof = cf.prove_locks(S04, -DRAWN, DRAWN, **bounds, nodes=20_000)
    states = inside(-DRAWN, DRAWN, 1_000, 11)
    states = states[is_decided(proof, onto_faces(states))]
    assert len(states) > 900
    draw = generator(12)
    shape = len(states), 2
    share = draw.choice([-1.0, 1.0, 0.0], shape) * draw.choice([1.0, 0.5], shape)
    pointing = draw.normal(size=(*shape, 3)) * [1, 1, 0]
    pointing *= bounds.get("pointing_error", 0.0) / np.linalg.norm(pointing, axis=-1, keepdims=True)
    ramps = draw.random(shape) < 0.5
    each = {
        "pointing": pointing,
        "start": bounds.get("timing_error", 0.0) * share,
        "slew_rate": bounds.get("rate_error", 0.0) * draw.choice([-1.0, 1.0], shape),
        "slew_acceleration": np.where(ramps, bounds.get("slew_acceleration", inf), inf),
    }
    found = cf.lock_times(S04, states[:, :3], states[:, 3:], cf.SearchErrors(**each))
    assert (found.time <= S04.duration).all()
    for k in np.argsort(-found.time)[:1]:
        own = {name: values[k] for name, values in each.items()}
        assert lock_of_bodies(states[k], own) <= S04.duration


def exact_boresight(time):
    """Return A's boresight in S04's search to 50 digits."""
    mp = mpmath.mp
    half_angle, rate = 7 * mp.pi / 18, mp.pi / 720
    tip = mp.atan(mp.cos(half_angle) / mp.sqrt(1 - 2 * mp.cos(half_angle) ** 2))  # S04 eq. 1
    multiples = [1, -2, "sun", 2, "sun", -2, 1]
    angles = 2 * [("sun", 3 * mp.pi), *(("sun", mp.pi) if k == "sun" else ("y", k * tip) for k in multiples)]
    x, y = mp.matrix([0, 0, -1]), mp.matrix([0, 1, 0])
    b, left = mp.matrix([1, 0, 0]), mp.mpf(time) * rate
    for about, angle in angles:
        axis, turn = (mp.matrix([0, 0, -1]) if about == "sun" else y), mp.sign(angle) * min(abs(angle), left)
        x, y, b = (exact_turn(axis, turn, vector) for vector in (x, y, b))
        left -= abs(turn)
    return b


def exact_turn(axis, angle, vector):
    c, s = mpmath.cos(angle), mpmath.sin(angle)
    a, v = list(axis), list(vector)
    along = sum(p * q for p, q in zip(a, v, strict=True))
    cross = [a[1] * v[2] - a[2] * v[1], a[2] * v[0] - a[0] * v[2], a[0] * v[1] - a[1] * v[0]]
    return mpmath.matrix([c * v[k] + s * cross[k] + (1 - c) * along * a[k] for k in range(3)])


def test_bounds_agree_with_interval_arithmetic():
    """Interval arithmetic confirms the largest provable box, and that no larger one is."""
    mpmath.mp.dps = 50
    table = instants_of(S04, S04.duration, ErrorBounds())
    draw = generator(6)
    for state in inside(-DRAWN, DRAWN, 1, 5):
        line = state[:3] + table[:, :1] * state[3:]
        angle = np.arccos((table[:, 1:4] * line).sum(1) / np.linalg.norm(line, axis=1))
        least = float(angle.min())
        error = radians(70) - least - 0.3 * draw.uniform(0.1, 1.0) * (radians(70) - least)
        reach = DRAWN * draw.uniform(0.1, 1.0, 6)

        def proven(share, state=state, reach=reach, error=error):
            return cf.prove_locks(
                S04, state - share * reach, state + share * reach, pointing_error=error, nodes=1
            ).ok

        low, high = 0.0, 1.0
        for _ in range(45):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if proven(middle) else (low, middle)
        assert 0.0 < low < 1.0
        assert worst_margin(table, state, low * reach, error) < 0
        assert worst_margin(table, state, low * (1 + 1e-9) * reach, error) > -1e-8 * np.linalg.norm(DRAWN)


def worst_margin(table, state, reach, error):
    """Return the largest g of theory (13) in a box at its best look, by intervals of 50 digits."""
    iv = mpmath.iv
    iv.dps = 50
    best = inf
    for row in table:
        centre = state[:3] + row[0] * state[3:]
        spread = reach[:3] + row[0] * reach[3:]
        corners = np.stack(np.meshgrid(*zip(centre - spread, centre + spread, strict=True)), -1).reshape(
            -1, 3
        )
        rough = (np.linalg.norm(corners, axis=1) * cos(radians(70) - error) - corners @ row[1:4]).max()
        if rough < best:
            best, look = rough, row
    b = exact_boresight(look[0])
    c = mpmath.cos(7 * mpmath.pi / 18 - mpmath.mpf(error))
    worst = -inf
    for signs in np.ndindex(2, 2, 2):
        p = [
            iv.mpf(float(state[k]))
            + iv.mpf(float(look[0])) * iv.mpf(float(state[3 + k]))
            + (2 * signs[k] - 1)
            * (iv.mpf(float(reach[k])) + iv.mpf(float(look[0])) * iv.mpf(float(reach[3 + k])))
            for k in range(3)
        ]
        g = iv.sqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2) * c - sum(p[k] * b[k] for k in range(3))
        worst = max(worst, float(g.b))
    return worst


def test_proof_with_offset_and_range():
    """A sensor with offset and range: every sampled state locks."""
    sensor = cf.Sensor(radians(70), offset=7.5, range=600.0)
    search = cf.Search.basic(sensor, RATE, LIMIT)
    low, high = np.array([80, -90, -60, -0.02, -0.02, -0.02]), np.array([220, 90, 60, 0.02, 0.02, 0.02])
    bounds = {"pointing_error": radians(3), "timing_error": 4.0}
    proof = cf.prove_locks(search, low, high, **bounds, nodes=200_000)
    assert proof.ok
    assert proof.proven == 1.0
    states = inside(low, high, 3000, 7)
    draw = generator(8)
    off = draw.normal(size=(len(states), 2, 3))
    off *= radians(3) / np.linalg.norm(off, axis=-1, keepdims=True)
    late = draw.choice([-4.0, 4.0], (len(states), 2))
    errors = cf.SearchErrors(pointing=off, start=late)
    assert (cf.lock_times(search, states[:, :3], states[:, 3:], errors).leg >= 0).all()
    beyond = np.array([700.0, 0, 0, 0.0, 0, 0])
    far = cf.prove_locks(search, beyond - 9.0 * (high > 1), beyond + 9.0 * (high > 1), nodes=50)
    assert far.proven == 0.0
    assert len(far.counterexamples) == far.nodes


def test_errors_larger_than_the_cone():
    near = np.array([300.0, 0, 0, 0, 0, 0])
    proof = cf.prove_locks(S04, near, near + 1.0, pointing_error=radians(71), nodes=3)
    assert proof.open == 1.0
    assert len(proof.counterexamples) == 3
    assert cf.prove_locks(S04, near, near + 1.0, pointing_error=radians(69), nodes=3).ok
    late = cf.prove_locks(S04, near, near + 1.0, timing_error=281.0, nodes=3)
    assert late.open == 1.0
    assert len(late.counterexamples) > 0  # one turns before the other begins
    assert_never_lock(late)


def test_cone_wider_than_a_hemisphere():
    """The proof uses half of the sky and loses little."""
    wide = cf.Search.basic(cf.Sensor(radians(110)), RATE, LIMIT)
    assert cf.prove_locks(wide, -DRAWN, DRAWN, nodes=20_000).open < 1e-4


def test_invalid_input():
    for arguments, message in [
        ({"low": DRAWN}, "low: component 0 of 1000 is above 1 of high; exchange them"),
        ({"low": np.zeros(6), "high": np.zeros(6)}, "high: the box contains only the origin"),
        ({"pointing_error": -0.1}, "pointing_error: must be finite and at least 0, got -0.1"),
        ({"rate_error": 1.0}, "rate_error: must be below 1, got 1"),
        ({"slew_acceleration": 0.0}, "slew_acceleration: must be positive, got 0"),
        ({"nodes": 0}, "nodes: expected a whole number of at least 1, got 0"),
    ]:
        given = {"search": S04, "low": -np.ones(6), "high": np.ones(6)} | arguments
        with pytest.raises(ValueError, match=message):
            cf.prove_locks(**given)
