"""Unavoidable conflicts: pairs in conflict at a place or time that no plan can change."""

from closeform.motion.arc import END, START
from closeform.planning.obstacles import short_of
from closeform.planning.passive_ends import unsafe_end
from closeform.planning.plan import Status
from closeform.planning.problem import Problem
from closeform.planning.request import Request
from closeform.planning.side_search import MARGINS


def hopeless(problem: Problem, request: Request) -> tuple[Status, tuple[int, int], str] | None:
    """Return status, pair and reason why no clear plan between these states exists; else None."""
    names = request.names
    if held := _held(problem.without_drift, request):
        pair, words = held
        return Status.END_INSIDE, pair, f"{names[pair[0]]} and {names[pair[1]]} {words}"
    if problem.drift is not None and (unsafe := unsafe_end(problem)):
        return Status.END_UNSAFE, unsafe.pair, unsafe.reason(problem, names)
    return None


def _held(problem: Problem, request: Request) -> tuple[tuple[int, int], str] | None:
    """Return the pair in the deepest unavoidable conflict, and a description of it; else None."""
    found, flown = [], problem.direct
    if request.cost == "delta-v" and not problem.conflicts(flown):  # clear without a margin
        return None
    for pair, (begin, end, time, ratio) in problem.conflicts(flown, MARGINS[0]):
        spans = sorted(tuple(problem.base[c, [START, END]]) for c in pair if c < problem.count)
        first, last = spans[0][0], max(span[1] for span in spans)
        if begin <= first:
            ratio = ratio if time <= first else problem.ratio(flown, pair, first)
            found.append((ratio, pair, "at their start", first))
        elif end >= last:
            ratio = ratio if time >= last else problem.ratio(flown, pair, last)
            found.append((ratio, pair, "at their end", last))
        elif spans[0][1] <= spans[-1][0] and begin <= spans[-1][0] and end >= spans[0][1]:
            found.append((ratio, pair, "at a time when both coast", time))
    if not found:
        return None
    ratio, pair, when, time = min(found)
    short = short_of(problem, request.padding, request.zones, pair, time)
    less = ", or reduce the margin" if short is not None and not short.inside else ""
    return pair, f"are at {short or problem.depth(ratio)} {when}; move one of them{less}"
