"""No lower bound is above a clear plan by cone programs: on all sides, with each requirement."""

import clarabel
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.sparse import csc_matrix

import closeform as cf
from passive_plans import MATRIX, ORBIT

TIME, DRIFT, RADIUS, SIGMAS = 1200.0, 900.0, 30.0, 2.0
START, END = np.array([5.0, -150.0, -4.0, 0, 0, 0]), np.array([-3.0, 150.0, 10.0, 0, 0, 0])
DIRECT = {"energy": ORBIT.transfer(START, END, TIME), "delta-v": ORBIT.impulsive(START, END, TIME)}
BESIDE = np.array([12.0, 3.0, 3.0])  # m, from where the direct path passes to an obstacle at rest there
KNOWN = np.diag([2.0, 3.0, 1.0, 2e-3, 1e-3, 1e-3]) ** 2
COUNT = 120
GRID = np.linspace(0.0, TIME, COUNT + 1)
LATER = np.arange(GRID[1], TIME + DRIFT, GRID[1])
APART = 1.002  # times the zone: clear between the times of the grid as well
CENTRE, TOLERANCE = np.array([-20.0, 75.0, 20.0]), 5.0
WAYPOINT = cf.requirements.KeepIn(zone=cf.Sphere(TOLERANCE), centre=CENTRE, start=900.0, end=900.0)
SHARE = {("energy", "waypoint"): 0.75}  # its bound is the larger one of zones and of requirements
LIMIT = {"energy": 2e-3, "delta-v": 4e-3}


def responses(times, cost):
    """Return the states (T, 6, 3 COUNT) due to impulses at the grid, or to thrust held between its times."""
    system = np.zeros((9, 9))
    system[:6, :6], system[3:6, 6:] = MATRIX, np.eye(3)
    held = expm(system * GRID[1])[:6, 6:] / GRID[1]
    begin, effect = (GRID[1:], held) if cost == "energy" else (GRID[:-1], np.eye(6)[:, 3:])
    after = np.maximum(times[:, None] - begin, 0.0)
    steps, which = np.unique(np.round(after, 9), return_inverse=True)
    moved = np.array([expm(MATRIX * step) @ effect for step in steps])[which.reshape(after.shape)]
    moved[times[:, None] < begin - 1e-9] = 0.0
    return moved.transpose(0, 2, 1, 3).reshape(len(times), 6, 3 * COUNT)


def program(cost, aims, planes, waypoint, limited):
    """Return the pushes (3 COUNT,) of minimum cost that satisfy planes a . u >= b, and that cost."""
    (ends, gap), count = aims, 3 * COUNT
    sizes = np.zeros((4 * COUNT, 4 * COUNT))
    for k in range(COUNT):
        sizes[4 * k, count + k] = -1.0
        sizes[4 * k + 1 : 4 * k + 4, 3 * k : 3 * k + 3] = -np.eye(3)
    rows, bounds = [np.hstack([ends, np.zeros((6, COUNT))]), sizes], [gap, np.zeros(4 * COUNT)]
    cones = [clarabel.ZeroConeT(6), *[clarabel.SecondOrderConeT(4)] * COUNT]
    rows.append(np.hstack([-planes[0], np.zeros((len(planes[1]), COUNT))]))
    bounds.append(-planes[1])
    if limited:
        rows.append(np.hstack([np.zeros((COUNT, count)), np.eye(COUNT)]))
        bounds.append(np.full(COUNT, LIMIT[cost] * GRID[1]))
    cones.append(clarabel.NonnegativeConeT(sum(map(len, bounds[2:]))))
    if waypoint is not None:
        rows.append(np.vstack([np.zeros(4 * COUNT), np.hstack([-waypoint[0], np.zeros((3, COUNT))])]))
        bounds.append(np.append(TOLERANCE, waypoint[1] - CENTRE))
        cones.append(clarabel.SecondOrderConeT(4))
    linear, square = np.zeros(4 * COUNT), np.zeros(4 * COUNT)
    if cost == "energy":
        square[:count] = 1.0 / GRID[1]
    else:
        linear[count:] = 1.0
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    given = csc_matrix(np.diag(square)), linear, csc_matrix(np.vstack(rows)), np.concatenate(bounds)
    found = clarabel.DefaultSolver(*given, cones, settings).solve()
    return (np.array(found.x)[:count], found.obj_val) if str(found.status) == "Solved" else (None, np.inf)


def rock_of(cost):
    """Return the initial state of an obstacle that is at rest near the middle of the direct path."""
    met = np.append(DIRECT[cost].position(0.5 * TIME) + BESIDE, np.zeros(3))
    return expm(-0.5 * TIME * MATRIX) @ met


def cheapest(cost, requirement):
    """Return the least cost of paths that begin on four sides, clear at the times of the grid."""
    flows, rock = {time: expm(MATRIX * time) for time in np.append(LATER, TIME)}, rock_of(cost)
    ends = responses(np.array([TIME]), cost)[0]
    aims = ends, END - flows[TIME] @ START
    before = LATER[LATER <= TIME + 1e-6]
    moves, coasts = responses(before, cost), np.array([flows[time] @ START for time in before])
    rocks = np.array([flows[time] @ rock for time in before])
    reach = np.zeros((len(before), 3, 3))
    if requirement == "errors":
        reach = np.array([(flows[time] @ KNOWN @ flows[time].T)[:3, :3] for time in before])
    moves, coasts, rocks = moves[:, :3], coasts[:, :3], rocks[:, :3]
    if requirement == "drift":  # loss of thrust at every third time of the grid, and at the start
        late = [(moves, coasts, rocks)]
        for lost in np.append(0, np.arange(2, COUNT, 3)):
            after = LATER[lost:]
            failed = responses(after, cost)[:, :3] * np.repeat(GRID[:-1] < GRID[lost] - 1e-6, 3)
            drifts = (np.array([flows[t] @ one for t in after])[:, :3] for one in (START, rock))
            late.append((failed, *drifts))
        moves, coasts, rocks = map(np.concatenate, zip(*late, strict=True))
        reach = np.zeros((len(coasts), 3, 3))
    waypoint = None
    if requirement == "waypoint":
        waypoint = moves[np.abs(before - 900.0).argmin()], coasts[np.abs(before - 900.0).argmin()]
    coasts = coasts - rocks
    least, costs = np.linalg.lstsq(aims[0], aims[1], rcond=None)[0], [np.inf]
    for side in np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 1], [0, 0, -1]]):
        places = coasts + moves @ least
        places = places + 2.0 * RADIUS * side * np.exp(-((places[:, 1:2] / 60.0) ** 2))
        for _ in range(4):
            sizes = np.linalg.norm(places, axis=1)
            ways = places / sizes[:, None]
            extents = APART * RADIUS + SIGMAS * np.sqrt(np.einsum("ki,kij,kj->k", ways, reach, ways))
            near = sizes < 2.5 * extents
            rows = np.einsum("ki,kim->km", ways, moves)
            planes = rows[near], (extents - (ways * coasts).sum(axis=1))[near]
            pushes, spent = program(cost, aims, planes, waypoint, requirement == "limit")
            if pushes is None:
                break
            places = coasts + moves @ pushes
            if ((ways * places).sum(axis=1) >= extents - 1e-6).all():
                costs.append(spent)
    return min(costs)


@pytest.mark.parametrize(
    "requirement",
    ["limit", "errors", *(pytest.param(one, marks=pytest.mark.slow) for one in ("drift", "waypoint"))],
)
@pytest.mark.parametrize("cost", ["energy", "delta-v"])
def test_bound_is_below_clear_plans_on_all_sides(cost, requirement):
    """The proof raises the bound to nearly the cost, and no cone program finds a clear plan below it."""
    client = ORBIT.coast(rock_of(cost), TIME + DRIFT)
    keep = {
        "limit": {"max_acceleration": LIMIT[cost], "longer": False},
        "errors": {"errors": cf.Uncertainty(KNOWN), "sigmas": SIGMAS},
        "drift": {"drift": DRIFT},
        "waypoint": {"requirements": WAYPOINT},
    }[requirement]
    plan = cf.avoid(DIRECT[cost], client, cf.Sphere(RADIUS), cost=cost, **keep, prove=2.0)
    assert plan.ok, plan.reason
    best = cheapest(cost, requirement)
    assert plan.lower_bound <= min(best, plan.spent)
    assert plan.lower_bound > SHARE.get((cost, requirement), 0.88) * best
