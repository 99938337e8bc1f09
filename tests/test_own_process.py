"""What processes of our own do before all else."""

import pytest

from closeform.own_process import with_room

resource = pytest.importorskip("resource")
CALLS = 300  # each of which costs a page, where it is the one that does not fit in a piece of frames


def pages():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt


def pages_of_calls(depth):
    """How many pages the system hands out while a function this deep calls another."""
    if depth:
        return pages_of_calls(depth - 1)
    before = pages()
    for _ in range(CALLS):
        pages()
    return pages() - before


def test_no_call_asks_the_system_for_room():
    """At whatever depth: without room a call in every hundred depths does, each time."""
    assert with_room(lambda: max(map(pages_of_calls, range(400)))) < CALLS // 10
