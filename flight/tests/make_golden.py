"""Golden vectors of the package for the C core: pairs with their conflicts and closest approach, transfers, locks.

Numbers are hexadecimal: exact.  Run: python make_golden.py > golden_vectors.h
"""

import numpy as np
from random_pairs import groups

import closeform as cf
from closeform.conflicts.entries import approaches_of_pairs, conflicts_of_pairs
from closeform.conflicts.tracks import NO_TRACKS

MOST = 8


def row(values):
    return "{" + ", ".join(float(v).hex() for v in np.ravel(values)) + "}"


def main():
    print("/* Made by make_golden.py with the Python package: do not edit. */")
    print("#ifndef GOLDEN_VECTORS_H\n#define GOLDEN_VECTORS_H\n#include \"closeform_flight.h\"")
    print(f"#define GOLDEN_STAYS {MOST}")
    print("typedef struct { double one[2][30]; double other[2][30]; unsigned one_count, other_count; int shape; double matrix[3][3];"
          " int conflicts; double conflict[GOLDEN_STAYS][2]; double closest_time, closest_ratio; } golden_pair_t;")
    pairs = []
    for orbit, one, other, zone, label in groups(11, 48, 40):
        a, ao, b, bo = one.arcs, one.offsets, other.arcs, other.offsets
        count = len(ao) - 1
        which = np.arange(count)
        rows, done, near = np.empty((64 * count, 5)), np.zeros(2, dtype=np.int64), np.empty((count, 2))
        total = conflicts_of_pairs(a, ao, b, bo, which, which, 0, zone.form, *NO_TRACKS, rows, done)
        approaches_of_pairs(a, ao, b, bo, which, which, zone.form, near)
        hits = np.bincount(rows[:total, 0].astype(int), minlength=count)
        some = [*np.nonzero(hits)[0][:3], *np.nonzero(hits == 0)[0][:1]]
        for p in some:
            conflicts = rows[:total][rows[:total, 0] == p][:, 1:3]
            if len(conflicts) > MOST:
                continue
            pad = np.zeros((MOST, 2))
            pad[: len(conflicts)] = conflicts
            parts = []
            for arcs, offsets in ((a, ao), (b, bo)):
                mine = np.zeros((2, 30))
                mine[: offsets[p + 1] - offsets[p]] = arcs[offsets[p] : offsets[p + 1]]
                parts.append("{" + row(mine[0]) + ", " + row(mine[1]) + "}")
            m = zone.form[1]
            matrix = "{" + ", ".join(row(m[i]) for i in range(3)) + "}"
            conflict = "{" + ", ".join(row(s) for s in pad) + "}"
            pairs.append(f"    /* {label} */\n    {{{parts[0]},\n     {parts[1]},\n     {ao[p + 1] - ao[p]}U, {bo[p + 1] - bo[p]}U, {zone.form[0]}, {matrix},\n"
                         f"     {len(conflicts)}, {conflict}, {float(near[p, 0]).hex()}, {float(near[p, 1]).hex()}}},")
    print(f"#define GOLDEN_PAIRS {len(pairs)}\nstatic const golden_pair_t golden_pairs[GOLDEN_PAIRS] = {{")
    print("\n".join(pairs))
    print("};")
    rng = np.random.default_rng(12)
    print("typedef struct { double n, start, duration, initial[6], final[6], thrust[6], energy; } golden_transfer_t;")
    rows = []
    for n in (0.0, 1e-9, 1e-6, 7.292e-5, 1.1086e-3):
        for k in range(10):
            duration = rng.uniform(0.01, 1.0) * (3 * 2 * np.pi / n if n > 1e-5 else 2e4)
            a, b = rng.normal(size=(2, 6)) * np.array([100.0] * 3 + [0.1] * 3)
            path = cf.Orbit(n).transfer(a, b, duration, 5.0 * k)
            rows.append(f"    {{{n.hex()}, {(5.0 * k).hex()}, {float(duration).hex()}, {row(a)}, {row(b)}, {row(path.arcs[0, 12:18])}, {float(path.energy).hex()}}},")
    print(f"#define GOLDEN_TRANSFERS {len(rows)}\nstatic const golden_transfer_t golden_transfers[GOLDEN_TRANSFERS] = {{")
    print("\n".join(rows))
    print("};")
    sensor = cf.Sensor(np.radians(55.0), offset=7.5, range=800.0)
    search = cf.Search.modified(sensor, np.radians(0.25), np.radians(45.0))
    print(f"#define GOLDEN_SLEW {search.slew_rate.hex()}\n#define GOLDEN_TIP {float(search.tip_angle).hex()}")
    print(f"#define GOLDEN_BASELINE {sensor.baseline.hex()}\n#define GOLDEN_COSINE {sensor.cosine.hex()}\n#define GOLDEN_RANGE {sensor.range.hex()}")
    positions, velocities = rng.normal(size=(100, 3)) * 300.0, rng.normal(size=(100, 3)) * 0.1
    locks = cf.lock_times(search, positions, velocities)
    print("typedef struct { double state[6]; double time; int leg; } golden_lock_t;")
    print("static const golden_lock_t golden_locks[100] = {")
    for r, v, t, leg in zip(positions, velocities, locks.time, locks.leg, strict=True):
        print(f"    {{{row([*r, *v])}, {float(t if leg >= 0 else 0.0).hex()}, {leg}}},")
    print("};")
    avoided()
    print("#endif")


def avoided():
    """Transfers through an obstacle, and what the cheapest path around its ellipsoid costs more."""
    rng, zone = np.random.default_rng(13), cf.Ellipsoid([20.0, 40.0, 20.0])
    print("typedef struct { double direct[30], obstacle[30], extra_energy; } golden_avoid_t;")
    print("static const double golden_avoid_zone[9] = " + row(zone.form[1]) + ";")
    rows = []
    for n in (0.0, 1.1086e-3):
        for k in range(10):
            orbit, duration = cf.Orbit(n), rng.uniform(300.0, 3000.0)
            way = rng.normal(size=3)
            begin, end = np.zeros((2, 6))
            begin[:3], end[:3] = 200.0 * way / np.linalg.norm(way), -200.0 * way / np.linalg.norm(way)
            direct = orbit.transfer(begin, end, duration)
            met = rng.uniform(0.3, 0.7) * duration
            there = direct.state(met) * np.array([1.0] * 3 + [0.0] * 3) + np.array([*rng.normal(size=3) * 8.0, 0.0, 0.0, 0.0])
            obstacle = orbit.coast(np.asarray(orbit.transition(-met)) @ there, duration)
            shaped = cf.avoid(direct, obstacle, zone)
            if shaped.ok and len(shaped.contacts) == 1:
                rows.append(f"    {{{row(direct.arcs)}, {row(obstacle.arcs)}, {float(shaped.extra_energy).hex()}}},")
    print(f"#define GOLDEN_AVOIDED {len(rows)}\nstatic const golden_avoid_t golden_avoided[GOLDEN_AVOIDED] = {{")
    print("\n".join(rows))
    print("};")


main()
