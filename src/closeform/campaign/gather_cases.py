"""Cases of gatherings, each done when one formation set holds all craft, and what they came to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import compress
from typing import Any, ClassVar, Self

import numpy as np

from closeform.arrays import Floats
from closeform.campaign.cases import Cases, Columns
from closeform.campaign.chunks import CaseChunks
from closeform.campaign.draws import drawn, failures, lost_by, searching, varied
from closeform.campaign.lock_cases import WITHIN_SUN, apart, within_sun_limit
from closeform.campaign.phase_columns import ended
from closeform.campaign.search_campaign import Campaign, Measured
from closeform.campaign.tally import Settled
from closeform.planning.limits import FULL, propellant
from closeform.scenario import Scenario
from closeform.scenario.stages import Gather
from closeform.scenario.study import FAILS
from closeform.search.burn_errors import gather_failing
from closeform.search.gather import gather_cases
from closeform.search.gatherings import Gatherings
from closeform.search.phases import ended_in
from closeform.search.rounds import all_rounds
from closeform.search.schedule import Search

AT_ONCE = 8192  # gatherings in a chunk
ALSO = "delta_v_m_s", "met_unknown", "met_known"  # columns that the tally takes too
CAUSES = {  # columns of what is spent beside joining, by what a study says of it
    "corrections_m_s": "on corrections against collisions",
    "near_field_m_s": "in the near-field search",
}
KEPT = {  # columns, by what is kept
    "clear": "clear",
    "delta-v": "delta_v_kept",
    "propellant": "propellant_kept",
    "thrust": "none_adrift",
    "sun": WITHIN_SUN,
}


@dataclass(frozen=True, eq=False)
class GatherCases(Cases):
    """Cases with a row each: `duration_s`, `leg`, `rounds`, `left`, `delta_v_m_s`, who met, what is kept.

    Of the delta-v what goes into corrections and the near-field search, where there may be such.
    Where craft may lose their thrust, when each does, and how many are `adrift` for it.  `search`: over all
    rounds.
    """

    stage: Gather
    search: Search

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """The cases of a scenario that gathers."""
        (stage,) = scenario.stages
        assert isinstance(stage, Gather)
        told = scenario.gathering(stage)
        search, _ = all_rounds(scenario.plan, told["rounds"], told["max_speed"])
        return cls(scenario, seed, stage, search)

    @property
    def at_once(self) -> int:
        """Cases in a chunk."""
        return AT_ONCE

    @property
    def causes(self) -> tuple[str, ...]:
        """Which of CAUSES there may be."""
        near = any(leg.phase == "NFS" for leg in self.search.legs)
        return tuple(compress(CAUSES, (bool(self.scenario.zones.pairs), near)))

    def fly(self, first: int, last: int) -> Columns:
        """Gatherings of all craft."""
        scenario = self.scenario
        pairs = np.stack(np.triu_indices(len(scenario.craft), 1), axis=1)
        states = drawn(scenario, self.seed, first, last)
        apart(scenario, states, pairs, first)
        told = scenario.gathering(self.stage) | {"errors": searching(scenario, self.seed, first, last)}
        flown, lost = (scenario.plan, states[..., :3], states[..., 3:]), {}
        if FAILS in varied(scenario):
            found, fails = gather_failing(*flown, failures(scenario, self.seed, first, last), **told)
            lost = {lost_by(name): fails[:, k] for k, name in enumerate(scenario.names)}
            lost |= {"adrift": found.adrift}
        else:
            found = gather_cases(*flown, **told)
        return {
            "duration_s": np.where(found.leg < 0, np.nan, found.duration),
            "leg": found.leg,
            "rounds": found.rounds,
            "left": found.left,
            "delta_v_m_s": found.delta_v,
            **{name: found.columns()[name] for name in self.causes},
            "met_unknown": found.met_unknown,
            "met_known": found.met_known,
            **lost,
            **{KEPT[what]: kept for what, kept in within_limits(scenario, found).items()},
            **within_sun_limit(scenario, self.search, told["errors"], last - first),
        }

    def good(self, columns: Columns) -> Any:
        """In which cases all are gathered, and keep what they should."""
        kept = [columns[name] for name in KEPT.values() if name in columns]
        return np.all([columns["leg"] >= 0, *kept], axis=0)

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """A row for each case, with its phase and round."""
        return super().stored(first, last, columns | ended(self.search, columns["leg"]))

    def campaign(self, chunks: CaseChunks) -> GatherCampaign:
        """What became of them."""
        return GatherCampaign(self, chunks)


@dataclass(frozen=True, eq=False, repr=False)
class GatherCampaign(Campaign):
    """Gatherings, each done when one formation set holds all craft.

    `rounds` (C,): searches begun; `left` (C,): craft not in the formation set; `delta_v` (C,) of
    all craft together [m/s]; `met_unknown` (C,): pairs that came within their keep-out zone before
    they knew each other, `met_known` (C,): only after.
    """

    kind: GatherCases
    done: ClassVar[str] = "gathered"

    @property
    def wanted(self) -> tuple[str, ...]:
        """The columns that say what became of a case."""
        return ("duration_s", "leg", *ALSO, *self.kind.causes, *KEPT.values())

    def settled(self, columns: Columns) -> Settled:
        """What became of the cases of a chunk."""
        kept = {what: columns[name] for what, name in KEPT.items() if name in columns}
        also = {name: columns[name] for name in (*ALSO, *self.kind.causes)}
        time = columns["duration_s"]
        return Settled(time, columns["leg"], kept, {}, time, also)

    @property
    def measured(self) -> dict[str, Measured]:
        """What `spreads` are about."""
        return super().measured | {"delta-v of all craft [m/s]": partial(caused, "delta_v_m_s")}

    @property
    def spent(self) -> dict[str, Measured]:
        """What `costs` are about, until craft are gathered: by cause, and by the phase in which that is."""
        causes, of = self.kind.causes, dict[str, Measured]()
        if causes:
            of["to join the formation set"] = partial(joining, causes)
        of |= {CAUSES[name]: partial(caused, name) for name in causes}
        for number, share in enumerate(self.shares[:-1]):
            if share.cases:
                name = f"gathered {'in ' * (number > 0)}{share.label}"
                of[name] = partial(spent_until, self.search, number)
        return of

    def column(self, name: str) -> Any:
        """One column of all cases."""
        return np.concatenate([part[name] for _, part in self.chunks.read(name)])

    @cached_property
    def rounds(self) -> Any:
        """Searches begun."""
        return self.column("rounds")

    @cached_property
    def left(self) -> Any:
        """Craft not in the formation set."""
        return self.column("left")

    @property
    def delta_v(self) -> Floats:
        """Of all craft together [m/s]."""
        spent: Floats = self._settled.also["delta_v_m_s"]
        return spent

    @property
    def met_unknown(self) -> Any:
        """Pairs that came within their keep-out zone before they knew each other."""
        return self._settled.also["met_unknown"]

    @property
    def met_known(self) -> Any:
        """Pairs that did so only after."""
        return self._settled.also["met_known"]


def caused(name: str, one: Settled) -> tuple[Floats, Any]:
    """What a column says is spent (C,) [m/s], and which cases are gathered."""
    return one.also[name], one.leg >= 0


def joining(causes: tuple[str, ...], one: Settled) -> tuple[Floats, Any]:
    """What is spent for none of them, to join the formation set."""
    rest = one.also["delta_v_m_s"] - sum(one.also[name] for name in causes)
    return np.maximum(rest, 0.0), one.leg >= 0  # of nothing but rounding nothing is left


def spent_until(search: Search, number: int, one: Settled) -> tuple[Floats, Any]:
    """What is spent (C,) [m/s], and which cases are gathered in a phase, by its number among all labels."""
    return one.also["delta_v_m_s"], ended_in(search, one.time, one.leg) == number


def within_limits(scenario: Scenario, flown: Gatherings) -> dict[str, Any]:
    """In which gatherings (C,) each clearance and limit that the file asks for is kept."""
    kept: dict[str, Any] = {}
    if scenario.zones.pairs:
        kept["clear"] = flown.met_unknown + flown.met_known == 0
    if FAILS in varied(scenario):
        kept["thrust"] = flown.adrift == 0
    for k, craft in enumerate(scenario.craft):
        spent = flown.each_delta_v[:, k]
        if craft.delta_v_budget is not None:
            kept["delta-v"] = kept.get("delta-v", True) & (spent <= FULL * craft.delta_v_budget)
        if craft.propellant is not None and craft.mass is not None and craft.specific_impulse is not None:
            burnt = propellant(craft.mass, spent, craft.specific_impulse)
            kept["propellant"] = kept.get("propellant", True) & (burnt <= FULL * craft.propellant)
    return kept
