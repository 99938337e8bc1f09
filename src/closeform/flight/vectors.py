"""Golden vectors: inputs and answers of the package, as a C header that `flight/tests/golden.c` replays.

Numbers are hexadecimal, so that every machine reads the same bits. Cases whose answer rounding could change
are left out: a closest approach within a millionth of the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from closeform.arrays import Floats
from closeform.conflicts.two_paths import closest_approach, find_conflicts
from closeform.flight.table import arrays_of, table_bytes
from closeform.motion.arc import WIDTH
from closeform.motion.joining import join
from closeform.motion.orbit import Orbit
from closeform.planning.avoid import avoid
from closeform.safety.drift_approach import passively_safe
from closeform.search.gathering.gather import gather
from closeform.search.lock_times import lock_times
from closeform.search.schedule import Search
from closeform.search.sensor import Sensor
from closeform.zones.solids import Box, Cylinder, Ellipsoid, Sphere
from closeform.zones.zone import Zone

NAME = "golden_vectors.h"
MOST = 8  # conflicts of a pair
GRAZING = 1e-6
NEAR = [8.0] * 3 + [0.005] * 3  # of an obstacle to the path that it blocks [m, m/s]
KINDS = ("coast", "transfer", "rest", "burn", "joined")
DEGREE = np.pi / 180.0

TYPES = f"""\
typedef struct {{ const cff_table_t *chief; double mean_motion; }} golden_orbit_t;
typedef struct {{
    int orbit; unsigned one_count, other_count, conflicts; cff_shape_t shape;
    double one[2][{WIDTH}], other[2][{WIDTH}], matrix[9], conflict[{MOST}][2], ratio;
}} golden_pair_t;
typedef struct {{
    int orbit; double start, duration, initial[6], final[6], middle[6], coasted[6], energy;
}} golden_transfer_t;
typedef struct {{
    int orbit; unsigned obstacles; double direct[{WIDTH}], obstacle[2][{WIDTH}], matrix[9], energy, bound;
}} golden_avoid_t;
typedef struct {{
    int orbit; double start, duration, initial[6], final[6], least;
}} golden_impulses_t;
typedef struct {{
    int orbit, safe; cff_shape_t shape; double path[{WIDTH}], other[{WIDTH}], matrix[9], until;
}} golden_loss_t;
typedef struct {{
    cff_schedule_t schedule; int basic; unsigned legs; double end, middle[9]; cff_sensor_t sensor;
}} golden_search_t;
typedef struct {{ int search; double state[6], time; int leg; }} golden_lock_t;
typedef struct {{
    int first; unsigned i, j, table_case; int label;
    double time, velocities[{MOST}][3], delta_v[{MOST}][3];
}} golden_join_t;
"""


def orbits() -> list[Any]:
    """Return deep space, and circular, eccentric and J2-perturbed orbits."""
    return [
        Orbit(0.0),
        Orbit.circular(500e3),
        Orbit.eccentric(0.3, perigee_altitude=500e3),
        Orbit.perturbed(0.001, 1.7, semi_major_axis=7000e3, span=6000.0),
    ]


def zones(rng: np.random.Generator) -> list[Zone]:
    """Return a zone of each shape."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    lengths = rng.uniform(10.0, 50.0, 3)
    return [
        Ellipsoid(lengths, axes),
        Sphere(lengths[0]),
        Box(lengths, axes),
        Cylinder(lengths[0], lengths[1], axes[0]),
    ]


def path_of(rng: np.random.Generator, orbit: Any, kind: str, duration: float, start: float) -> Any:
    """Return a path of some kind through the neighbourhood of the chief."""
    ends = rng.normal(size=(2, 6)) * ([20.0] * 3 + [0.03] * 3)
    ends[:, :3] += np.outer([1.0, -1.0], rng.normal(size=3) * 60.0)
    if kind == "rest":
        ends[:, 3:] = 0.0
    drift = rng.normal(size=6) * ([15.0] * 3 + [0.01] * 3)
    if kind == "coast":
        return orbit.coast(drift, duration, start=start)
    if kind == "burn":
        return orbit.burn(drift, rng.normal(size=3) * 60.0 / duration**2, duration, start=start)
    whole = orbit.transfer(*ends, 0.4 * duration if kind == "joined" else duration, start=start)
    if kind != "joined":
        return whole
    after = whole.state(whole.end) + [0.0, 0.0, 0.0, *rng.normal(size=3) * 0.01]
    return join([whole, orbit.coast(after, 0.6 * duration, start=start + 0.4 * duration)])


def pairs(rng: np.random.Generator) -> Iterator[str]:
    """Yield pairs of paths with their conflicts and closest approach."""
    for (number, orbit), one_kind, other_kind in product(enumerate(orbits()), KINDS, KINDS):
        for zone in zones(rng):
            start, duration = rng.uniform(0.0, 1000.0), rng.uniform(300.0, 3000.0)
            late = start + rng.uniform(0.0, 0.3) * duration
            one = path_of(rng, orbit, one_kind, duration, start)
            other = path_of(rng, orbit, other_kind, duration, late)
            met, ratio = find_conflicts(one, other, zone), closest_approach(one, other, zone).ratio
            if len(met) > MOST or any(abs(near - 1.0) < GRAZING for near in (ratio, *(c.ratio for c in met))):
                continue
            counts = f"{len(one.arcs)}U, {len(other.arcs)}U, {len(met)}U, (cff_shape_t){zone.shape}"
            arcs = ", ".join(row(padded(path.arcs, 2)) for path in (one, other))
            spans = padded(np.array([(c.start, c.end) for c in met]).reshape(-1, 2), MOST)
            yield f"{number}, {counts}, {arcs}, {row(zone.matrix)}, {row(spans)}, {float(ratio).hex()}"


def transfers(rng: np.random.Generator) -> Iterator[str]:
    """Yield transfers with the state in their middle and the energy, and coasts from the same state."""
    for number, orbit in enumerate(orbits()):
        for _ in range(16):
            start, duration = rng.uniform(0.0, 1000.0), rng.uniform(100.0, 5000.0)
            ends = rng.normal(size=(2, 6)) * ([100.0] * 3 + [0.1] * 3)
            path, coast = (
                orbit.transfer(*ends, duration, start=start),
                orbit.coast(ends[0], duration, start=start),
            )
            times, middle = f"{start.hex()}, {duration.hex()}", path.state(start + 0.5 * duration)
            rows = ", ".join(map(row, (*ends, middle, coast.state(start + duration))))
            yield f"{number}, {times}, {rows}, {float(path.energy).hex()}"


def impulses(rng: np.random.Generator) -> Iterator[str]:
    """Yield transfers by impulses with their minimum delta-v."""
    for number, orbit in enumerate(orbits()):
        for _ in range(4):
            start, duration = rng.uniform(0.0, 500.0), rng.uniform(1000.0, 5000.0)
            ends = rng.normal(size=(2, 6)) * ([100.0] * 3 + [0.1] * 3)
            least = orbit.impulsive(*ends, duration, start=start).delta_v
            given = f"{number}, {start.hex()}, {duration.hex()}, {row(ends[0])}, {row(ends[1])}"
            yield f"{given}, {float(least).hex()}"


def avoidances(rng: np.random.Generator) -> Iterator[str]:
    """Yield transfers through one or two obstacles, with the energy of the path around them and its bound."""
    zone = Ellipsoid([20.0, 40.0, 20.0])
    for number, orbit in enumerate(orbits()):
        for k in range(8):
            way, duration = rng.normal(size=3), rng.uniform(600.0, 2500.0)
            ends = np.zeros((2, 6))
            ends[:, :3] = np.outer([200.0, -200.0], way / np.linalg.norm(way))
            direct = orbit.transfer(*ends, duration)
            met = rng.uniform(0.3, 0.7, 1 + k % 2) * duration
            there = direct.state(met) * ([1.0] * 3 + [0.0] * 3) + rng.normal(size=(len(met), 6)) * NEAR
            states = [
                np.linalg.solve(orbit.transition(t), state) for t, state in zip(met, there, strict=True)
            ]
            others = orbit.coast(states, duration)
            plan = avoid(direct, others, zone)
            if plan.path is not None and plan.contacts:
                arcs = f"{row(direct.arcs[0])}, {row(padded(others.arcs, 2))}, {row(zone.matrix)}"
                costs = f"{float(plan.path.energy).hex()}, {float(plan.lower_bound).hex()}"
                yield f"{number}, {len(states)}U, {arcs}, {costs}"


def losses(rng: np.random.Generator) -> Iterator[str]:
    """Yield paths with the verdict on a loss of thrust."""
    for number, orbit in enumerate(orbits()):
        for zone in zones(rng) * 3:
            ends = rng.normal(size=(2, 6)) * ([60.0, 120.0, 60.0] + [0.02] * 3)
            path, other = orbit.transfer(*ends, 1500.0), orbit.coast(np.zeros(6), 5500.0)
            safe = passively_safe(path, other, zone, 5500.0)
            arcs = f"{row(path.arcs[0])}, {row(other.arcs[0])}, {row(zone.matrix)}"
            yield f"{number}, {int(safe)}, (cff_shape_t){zone.shape}, {arcs}, {(5500.0).hex()}"


def searches() -> list[tuple[Search, str]]:
    """Return searches, with the numbers by which the flight core makes them."""
    rate, limit = 0.25 * DEGREE, 25.0 * DEGREE
    wide, narrow = Sensor(70.0 * DEGREE, 7.5), Sensor(40.0 * DEGREE, 7.5, 800.0)
    relaxed = Search.basic(narrow, rate, limit, 2.0 * np.pi, passes=1, relaxed=True)
    return [
        (Search.modified(wide, rate, limit), "0.0, 0.0, 0U, false}, 0"),
        (Search.basic(narrow, rate, limit), f"{(3.0 * np.pi).hex()}, 0.0, 2U, false}}, 1"),
        (relaxed, f"{(2.0 * np.pi).hex()}, 0.0, 1U, true}}, 1"),
        (Search.modified(Sensor(110.0 * DEGREE, 5.0), rate, limit), "0.0, 0.0, 0U, false}, 0"),
    ]


def schedules() -> Iterator[str]:
    """Yield schedules with the attitude of group B at half time."""
    for search, numbers in searches():
        sensor, made = search.sensor, (search.sensor.half_angle, search.slew_rate, search.sun_limit)
        middle = search.attitude(0.5 * search.duration, "B").T
        cone = row([sensor.half_angle, sensor.offset, min(sensor.range, 1e60)])
        schedule = ", ".join(float(one).hex() for one in made)
        yield f"{{{schedule}, {numbers}, {len(search.legs)}U, {search.duration.hex()}, {row(middle)}, {cone}"


def locks(rng: np.random.Generator) -> Iterator[str]:
    """Yield pairs of lost spacecraft with their first locks."""
    for number, (search, _) in enumerate(searches()):
        states = rng.normal(size=(40, 6)) * ([300.0] * 3 + [0.1] * 3)
        found = lock_times(search, states[:, :3], states[:, 3:])
        for state, time, leg in zip(states, np.nan_to_num(found.time), found.leg, strict=True):
            yield f"{number}, {row(state)}, {float(time).hex()}, {leg}"


def joins(rng: np.random.Generator) -> Iterator[str]:
    """Yield the locks of gatherings with the sets and burns that follow."""
    search = Search.basic(Sensor(20.0 * DEGREE), 0.25 * DEGREE, 25.0 * DEGREE)
    for _ in range(12):
        positions, velocities = rng.normal(size=(2, MOST, 3)) * [[[150.0]], [[0.05]]]
        events = gather(search, positions, velocities, burns="half", rounds=1).events
        steps = [k for k, event in enumerate(events) if event.kind == "lock"]
        for k, step in enumerate(steps):
            lock, burns = events[step], np.zeros((MOST, 3))
            for event in events[step + 1 : (*steps, len(events))[k + 1]]:
                burns[event.first] = event.delta_v
            craft = f"{int(k == 0)}, {lock.first}U, {lock.second}U, {lock.case}U, {lock.label}"
            yield f"{craft}, {lock.time.hex()}, {row(velocities)}, {row(burns)}"
            velocities = velocities + burns


def tables() -> Iterator[str]:
    """Yield the tables of chiefs, and the orbits."""
    named = []
    for number, orbit in enumerate(orbits()):
        chief = getattr(orbit, "chief", None)
        if chief is None:
            named.append(f"{{NULL, {float(orbit.mean_motion).hex()}}}")
            continue
        numbers, arrays = arrays_of(chief)
        names = [
            f"golden_{name}_{number}"
            for name in ("joints", "rows", "steps", "errors", "returns", "return_errors")
        ]
        yield from (
            f"static const double {name}[] = {row(one.ravel())};"
            for name, one in zip(names, arrays, strict=True)
        )
        head = ", ".join(one.hex() for one in numbers[:-1])
        rest = ", ".join([f"{numbers[-1]}U", *names])
        yield f"static const cff_table_t golden_table_{number} = {{{head}, {rest}}};"
        named.append(f"{{&golden_table_{number}, 0.0}}")
    yield f"static const golden_orbit_t golden_orbits[] = {{{', '.join(named)}}};"


def padded(rows: Floats, count: int) -> Floats:
    """Return rows with rows of zeros up to a count."""
    return np.vstack([rows, np.zeros((count - len(rows), rows.shape[1]))])


def row(values: Any) -> str:
    """Return numbers as an initializer in C, with braces for the rows of an array."""
    numbers = np.asarray(values, dtype=float)
    if numbers.ndim == 2 and numbers.shape != (3, 3):
        return "{" + ", ".join(map(row, numbers)) + "}"
    text = ", ".join(float(one).hex() for one in numbers.ravel())
    return "{" + text.replace("nan", "NAN") + "}"  # mean motion of an arc about an eccentric chief


def vectors() -> str:
    """Return the header."""
    rng = np.random.default_rng(11)
    kinds = {
        "pair": pairs(rng),
        "transfer": transfers(rng),
        "avoid": avoidances(rng),
        "impulses": impulses(rng),
        "loss": losses(rng),
        "search": schedules(),
        "lock": locks(rng),
        "join": joins(rng),
    }
    parts = [
        "/* Made by `closeform flight-vectors` with the Python package. */",
        "#ifndef GOLDEN_VECTORS_H\n#define GOLDEN_VECTORS_H",
        '#include <math.h>\n#include <stddef.h>\n#include "closeform_flight.h"',
        TYPES,
        *tables(),
    ]
    for kind, cases in kinds.items():
        listed = list(cases)
        parts.append(f"#define GOLDEN_{kind.upper()}_COUNT {len(listed)}")
        body = ",\n".join(f"    {{{case}}}" for case in listed)
        parts.append(
            f"static const golden_{kind}_t golden_{kind}[GOLDEN_{kind.upper()}_COUNT] = {{\n{body},\n}};"
        )
    return "\n".join([*parts, "#endif", ""])


def upload() -> dict[str, bytes]:
    """Return the blocks that `flight/examples/uploaded_paths.c` reads."""
    orbit = Orbit.eccentric(0.3, perigee_altitude=500e3)
    own = orbit.transfer([0, 200, 0, 0, 0, 0], [0, -200, 0, 0, 0, 0], 600.0)
    other = orbit.coast([30, 0, 0, 0, 0, 0], 600.0)
    return {"table": table_bytes(orbit), "own": own.arcs.tobytes(), "other": other.arcs.tobytes()}


def write(folder: FilePath) -> FilePath:
    """Write the golden vectors to a folder, and the blocks of `upload`; return the file of vectors."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, block in upload().items():
        (folder / f"{name}.bin").write_bytes(block)
    file = folder / NAME
    file.write_text(vectors(), encoding="utf-8")
    return file
