"""Transfers of minimum energy by Hill's equations, also over tiny angles: the library against the package.

With CC="gcc -DCFF_LIBM_TRIGONOMETRY" the library takes the C library's sine, as the package does.
"""

import numpy as np

import closeform as cf

COUNT = 2_000  # for each mean motion


def main():
    rng, same = np.random.default_rng(3), 0
    worst = dict.fromkeys(("thrust", "energy", "end position"), 0.0)
    motions = (0.0, 1e-9, 1e-6, 7.292e-5, 1.1086e-3)
    for n in motions:
        orbit = cf.Orbit(n)
        longest = 6.0 * np.pi / n if n > 1e-5 else 2e4
        for _ in range(COUNT):
            duration, start = rng.uniform(1e-3, 1.0) * longest, rng.uniform(0.0, 1e3)
            ends = rng.normal(size=(2, 6)) * ([100.0] * 3 + [0.1] * 3)
            mine = cf.flight.transfer(orbit, *ends, duration, start)
            theirs = orbit.transfer(*ends, duration, start)
            a, b = mine.arcs[0, 12:18], theirs.arcs[0, 12:18]
            size = np.abs(b[:3]).max() + np.abs(b[3:]).max() * duration
            gap = (mine.state(mine.end) - ends[1])[:3]
            same += bool((mine.arcs == theirs.arcs).all())
            worst["thrust"] = max(worst["thrust"], np.abs(a - b)[:3].max() / size)
            worst["energy"] = max(worst["energy"], abs(mine.energy / theirs.energy - 1.0))
            worst["end position"] = max(worst["end position"], np.abs(gap).max() / np.abs(ends).max())
    relative = ", ".join(f"{name} {value:.2g}" for name, value in worst.items())
    print(f"{COUNT * len(motions)} transfers: {same} bit for bit; largest relative differences: {relative}")


main()
