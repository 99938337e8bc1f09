"""The ways in which a formation can pass each other: sides are chosen, relaxed, and the best kept."""

from dataclasses import dataclass, replace

import numpy as np

from closeform.arrays import Floats
from closeform.planning.plan import Touch
from closeform.planning.planner import TINY, Draft, Planner, Sides
from closeform.planning.pressing import convex
from closeform.planning.result import PLANNED
from closeform.planning.task import Contacts, Flown, Task

DEEP, ANY = 0.3, 1.0  # norm below which the side of a new contact is drawn, not the nearer one
PUSH, FAR = 0.3, 1.0  # of the zone, by which craft are set apart in thought before sides are drawn
BLUNT = 4.0  # power of the norm that stands in for a box while sides are chosen
SHARPER = (32.0, 512.0, 8192.0)  # and the powers after it, of balls that hold the box
SHALLOW = 0.3  # of the zone, by which a contact must push a pair for its other side to be tried
WAYS = ((6, 40), (12, 20), (30, 8), (80, 4), (200, 2))  # most ways for so many pairs in contact; else one
PATIENCE = 4  # ways without a better one after which the search ends
MORE = 24  # ways tried beside them where none of the first is clear
SHARPENED = 3  # of the best ways, until one is clear of its sharp boxes
FINER = 3  # times that the march may find what samples missed
LARGE = 150  # contacts beyond which the certificate is not computed


@dataclass(frozen=True, eq=False)
class Outcome:
    """Clear paths and where they touch, or None and the pair that is deepest in conflict.

    `order`: that in which craft planned one after another, where it is not the one asked for.
    """

    flown: Flown | None
    touches: tuple[Touch, ...]
    proven: bool
    tried: int
    blocked: tuple[int, int] | None = None
    order: tuple[int, ...] = ()

    @classmethod
    def of(cls, task: Task, draft: Draft, proven: bool, tried: int) -> "Outcome":
        """That of a clear draft."""
        return cls(draft.flown, touches(task, draft.contacts), proven, tried)


def drawn(seed: int, depth: float) -> Sides:
    """Sides as though every craft were shifted a little, so that the choices for all pairs agree.

    Only where the norm is below `depth`; beyond it the nearer side is taken.  Where any side is drawn, every
    other seed takes those along the motion: to pass before or behind by being early or late.
    """

    def sides(planner: Planner, contacts: Contacts, motions: Floats) -> Floats:
        places, speeds = motions[:, 0], motions[:, 1]
        bodies = len(planner.task.base) + len(planner.task.other_offsets) - 1
        shifts = np.random.default_rng(seed).normal(size=(bodies, 3)) * (FAR if depth == ANY else PUSH)
        first, second = planner.task.pairs[contacts.which].T
        apart = shifts[first] - shifts[second]
        pace = np.einsum("ki,ki->k", speeds, speeds)[:, None]
        if depth == ANY and seed % 2 == 0:
            moved = np.where(pace > 0.0, np.sign(apart[:, :1]) * speeds, apart)
        else:
            along = np.einsum("ki,ki->k", places + apart, speeds)[:, None] / np.maximum(pace, TINY)
            moved = places + apart - along * speeds
        deep = planner.norms(places, contacts.which) < depth
        return planner.normals(np.where(deep[:, None], moved, places)[:, None], contacts.which)

    return sides


def searched(task: Task, more: bool = False) -> Outcome:
    """The best of a number of ways, by how many pairs are in contact.

    First the nearer sides; then one pair after another turned to its other side; then all sides drawn anew.
    """
    planner = Planner(task, PLANNED[0], BLUNT)
    last = planner.relaxed(Contacts.none(), drawn(0, DEEP))
    found = [draft for draft in [certified(planner, last)] if draft is not None]
    tried = 1
    pairs = len(np.unique(last.contacts.which))
    count = next((ways for most, ways in WAYS if pairs <= most), 1) + (MORE if more else 0)
    turned: list[int] = []
    sure = bool(found) and proven(planner, found[0])
    improved = tried
    while tried < count and not sure and (more or not found or tried - improved < PATIENCE):
        start = turn_one(planner, found[0].contacts, turned) if found else None
        sides = drawn(0, DEEP) if start is not None else drawn(tried, ANY)
        bar = found[0].energy if found else np.inf
        draft = planner.relaxed(start if start is not None else Contacts.none(), sides, bar)
        tried += 1
        better = certified(planner, draft) if draft.energy < bar else None
        if better is not None and better.energy < bar:
            turned = turned if start is not None else []
            improved = tried
            found.insert(0, better)
            sure = proven(planner, better)
    for draft in found[:SHARPENED]:
        sharp = sharpened(planner, draft)
        if sharp is not None:
            return Outcome.of(task, sharp, proven(planner, sharp), tried)
    return Outcome(None, (), False, tried, deepest(task, last))


def from_sequence(task: Task, alone: Outcome, before: Outcome) -> Outcome:
    """What craft found one after another, shaped jointly on the same sides; else `before`."""
    tried = before.tried + alone.tried
    if alone.flown is None:
        return replace(before, tried=tried)
    planner = Planner(task, PLANNED[0], BLUNT)
    pairs = [(min(touch.first, touch.second), max(touch.first, touch.second)) for touch in alone.touches]
    which = np.array([task.index[pair] for pair in pairs], dtype=np.int64)
    times = np.array([touch.time for touch in alone.touches])
    draft = planner.relaxed(planner.nearest(alone.flown, which, times), drawn(0, DEEP))
    clear = certified(planner, draft)
    sharp = sharpened(planner, clear) if clear is not None else None
    if sharp is None or task.energy(sharp.flown) > task.energy(alone.flown):
        return replace(alone, tried=tried)
    return Outcome.of(task, sharp, False, tried + 1)


def turn_one(planner: Planner, contacts: Contacts, turned: list[int]) -> Contacts | None:
    """Contacts of which one pair passes on its other side: that which, left alone, would go nearest to it."""
    depths = contacts.force * planner.gram(contacts).diagonal()
    for k in np.argsort(-depths):
        which = int(contacts.which[k])
        if depths[k] > SHALLOW and which not in turned:
            turned.append(which)
            both = contacts.which[:, None] == which
            return replace(contacts, normals=np.where(both, -contacts.normals, contacts.normals))
    return None


def certified(planner: Planner, draft: Draft) -> Draft | None:
    """A draft that the march finds clear too; with boxes, which are rounded so far, as it is."""
    for _ in range(FINER):
        if not draft.clear:
            return None
        missed = planner.task.conflicts(draft.flown) if not planner.rounded(draft.contacts) else []
        if not missed:
            return draft
        draft = planner.relaxed(draft.contacts.joined(at_conflicts(planner, draft, missed)), drawn(0, 0.0))
    return None


def sharpened(planner: Planner, draft: Draft) -> Draft | None:
    """A certified draft with its boxes sharpened, ever closer to their edges while it stays clear."""
    task = planner.task
    if not planner.rounded(draft.contacts):
        return draft
    best: Draft | None = None
    for power in SHARPER:
        finer = Planner(task, PLANNED[0], power, 3.0 ** (1.0 / power), draft.contacts.which)
        for _ in range(FINER):
            draft = finer.relaxed(draft.contacts, drawn(0, 0.0))
            missed = task.conflicts(draft.flown) if draft.clear else []
            if not missed:
                break
            draft = replace(draft, contacts=draft.contacts.joined(at_conflicts(finer, draft, missed)))
        if draft.clear and not missed and (best is None or draft.energy < best.energy):
            best = draft
    return best


def at_conflicts(planner: Planner, draft: Draft, found: list[tuple[tuple[int, int], Floats]]) -> Contacts:
    """Contacts without force at the conflicts that the march has found; samples are taken there too."""
    which = np.array([planner.task.index[pair] for pair, _ in found])
    times = np.array([row[2] for _, row in found])
    planner.times = np.union1d(planner.times, times)
    return planner.nearest(draft.flown, which, times)


def deepest(task: Task, draft: Draft) -> tuple[int, int] | None:
    """The pair deepest in conflict in a draft."""
    found = task.conflicts(draft.flown)
    return min(found, key=lambda one: one[1][3])[0] if found else None


def touches(task: Task, contacts: Contacts) -> tuple[Touch, ...]:
    """Contacts in metres, in order of time."""
    pushes = np.einsum("kji,kj->ki", task.forms[contacts.which], contacts.normals)
    sizes = np.linalg.norm(pushes, axis=1)
    pairs = task.pairs[contacts.which]
    return tuple(
        Touch(
            float(contacts.times[k]),
            int(pairs[k, 0]),
            int(pairs[k, 1]),
            pushes[k] / sizes[k],
            float(contacts.force[k] * sizes[k]),
        )
        for k in np.argsort(contacts.times)
    )


def proven(planner: Planner, draft: Draft) -> bool:
    """Whether no paths that are clear at the times of a draft's contacts can cost less.

    The draft solves min |d|^2 / 2 subject to |q + d| >= aim at each contact, d in the span of the
    kernel.  Where the forces are so weak that the Lagrangian is convex, it is the global optimum of
    this relaxation, and so of the task.  Only for ellipsoids.                   # as shaping.proven
    """
    contacts, task = draft.contacts, planner.task
    if not draft.settled or len(contacts) > LARGE or task.boxes[contacts.which].any():
        return False
    if not len(contacts):
        return True
    links, blocks, _ = planner.answers(contacts)
    matrices = task.forms[contacts.which]
    k, m = links.T
    gram = np.zeros((len(contacts), 3, len(contacts), 3))
    gram[k, :, m, :] = np.einsum("lia,lab,ljb->lij", matrices[k], blocks[:, :3], matrices[m])
    size = 3 * len(contacts)
    return convex(gram.reshape(size, size), contacts.force / planner.aims[contacts.which])
