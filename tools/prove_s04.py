"""Prove which share of the samples of S04 always locks, for all errors within bounds.

    python tools/prove_s04.py --nodes 1000000
    python tools/prove_s04.py --nodes 1000000 --pointing-error 0.5 --timing-error 2

The proof treats each face of the box of all samples with its own nodes, so that memory is constant. S04
samples both spacecraft in cubes. Each component x of their difference, scaled to +-1, has density 1 - |x|.
"""

import argparse
import time

import numpy as np

import closeform as cf

DRAWN = np.array([1000.0, 1000.0, 1000.0, 0.4, 0.4, 0.4])  # m, m/s: B less A, each way
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)  # exact for polynomials up to degree 15


def share_of_draws(boxes: np.ndarray) -> float:
    """Return the probability of the cones over boxes (K, 2, 6) in faces of the box of all samples.

    A cone is {s x: 0 <= s <= 1, x in the box}; its volume element is s^5 ds dx, and the mean of 1 - s |x|
    over an interval is 1 - s times that of |x|.
    """
    low, high = np.moveaxis(boxes, 1, 0) / DRAWN
    width = high - low
    flat = width == 0.0
    distance = 0.5 * np.where((low < 0.0) & (high > 0.0), (low**2 + high**2), abs(high + low) * width)
    distance = np.where(flat, 1.0, distance / np.where(flat, 1.0, width))
    total = 0.0
    for node, weight in zip(0.5 * (NODES + 1.0), 0.5 * WEIGHTS, strict=True):
        total += weight * node**5 * (1.0 - node * distance).prod(axis=1)
    return float((total * np.where(flat, 1.0, width).prod(axis=1)).sum())


def main() -> None:
    parser = argparse.ArgumentParser(description="The share of S04's draws that is proven to lock.")
    parser.add_argument("--nodes", type=int, default=1_000_000, help="boxes judged in each of twelve faces")
    parser.add_argument("--pointing-error", type=float, default=0.0, help="deg")
    parser.add_argument("--timing-error", type=float, default=0.0, help="s")
    parser.add_argument("--rate-error", type=float, default=0.0)
    parser.add_argument("--slew-acceleration", type=float, default=np.inf, help="deg/s^2, the least")
    given = parser.parse_args()
    degree = np.pi / 180
    search = cf.Search.modified(cf.Sensor(70 * degree), 0.25 * degree, 25 * degree)
    begun, busy = time.perf_counter(), time.process_time()
    left, volume, boxes, found = 0.0, 0.0, 0, 0
    for axis in range(6):
        for sign in (-1.0, 1.0):
            low, high = -DRAWN, DRAWN.copy()
            low[axis] = high[axis] = sign * DRAWN[axis]
            proof = cf.prove_locks(
                search,
                low,
                high,
                pointing_error=given.pointing_error * degree,
                timing_error=given.timing_error,
                rate_error=given.rate_error,
                slew_acceleration=given.slew_acceleration * degree,
                nodes=given.nodes,
            )
            share = share_of_draws(proof.undecided)
            left, volume = left + share, volume + proof.open / 12
            boxes, found = boxes + len(proof.undecided), found + len(proof.counterexamples)
            face = f"{'+-'[sign < 0]}{('x', 'y', 'z', 'vx', 'vy', 'vz')[axis]}"
            print(f"face {face:>3}: {share:.2e} of the draws left, {len(proof.undecided)} boxes", flush=True)
    spent = f"{time.perf_counter() - begun:.0f} s, {time.process_time() - busy:.0f} s of processors"
    print(f"proven but for {left:.2e} of the draws, {volume:.2e} of their volume, in {boxes} boxes")
    print(f"{found} counterexamples; {spent}")


if __name__ == "__main__":
    main()
