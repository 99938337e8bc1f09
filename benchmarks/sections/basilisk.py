"""Simulation of the same plan by closeform and by Basilisk."""

import statistics
from time import process_time

import closeform as cf
from peers import basilisk_peer
from sections.field import FIELD, SIGHT, formation
from tables import Figure, Report, Table, seconds
from timing import timed

FEEDBACK = cf.Feedback()


def measure(quick: bool) -> Report:
    asked = {"open loop": 200, "with feedback": 50}
    if not basilisk_peer.available():
        figures = [
            Figure(f"against Basilisk, {how}", f">= {least}x", basilisk_peer.MISSING, None)
            for how, least in asked.items()
        ]
        return Report([Table("Simulation in Basilisk", ["method"], [], [basilisk_peer.MISSING])], figures)
    repeats, flights = (1, 10) if quick else (7, 100)
    plan, _ = formation(3, 8, 1.0)
    other = basilisk_peer.Simulated(plan, FIELD)
    runs = {
        "open loop": (lambda count: cf.simulate(plan, FIELD, "open", seeds=count), other.open_loop),
        "with feedback": (
            lambda count: cf.simulate(plan, FIELD, feedback=FEEDBACK, navigation=SIGHT, seeds=count),
            lambda: other.tracked(FEEDBACK, SIGHT),
        ),
    }
    coasts = statistics.median(other.coasting() for _ in range(repeats))
    rows, figures = [["physics alone", "", "", seconds(coasts), ""]], []
    for how, (ours, theirs) in runs.items():
        alone, _ = timed(lambda ours=ours: ours(1), repeats, process_time)
        many, _ = timed(lambda ours=ours: ours(flights), repeats, process_time)
        each, peer = many / flights, statistics.median(theirs() for _ in range(repeats))
        rows.append([how, seconds(alone), seconds(each), seconds(peer), f"{peer / each:.0f}x"])
        figures.append(
            Figure(
                f"against Basilisk, {how}",
                f">= {asked[how]}x",
                f"{peer / each:.0f}x",
                peer >= asked[how] * each,
            )
        )
    note = (
        f"Both use steps of 10 s, J2, one orbit, and eight spacecraft with their chief. {flights} "
        "simulations are one call. The physics of Basilisk are in C++; its thrust and feedback are a "
        "Python module that it calls at each step."
    )
    columns = ["run", "simulate, one", f"simulate, per sample of {flights}", "Basilisk", "speed-up"]
    return Report([Table("Simulation in Basilisk", columns, rows, [note])], figures)
