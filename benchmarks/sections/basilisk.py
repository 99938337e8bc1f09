"""Flights of the same plan by closeform and by Basilisk."""

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
        return Report([Table("Flights in Basilisk", ["method"], [], [basilisk_peer.MISSING])], figures)
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
        f"Eight craft and their chief, one orbit, J2, steps of 10 s by both; {flights} flights are one call. "
        "Basilisk's physics is C++, its thrust and feedback a Python module, asked at each step."
    )
    columns = ["", "fly, one", f"fly, of {flights} each", "Basilisk", "takes"]
    return Report([Table("Flights in Basilisk", columns, rows, [note])], figures)
