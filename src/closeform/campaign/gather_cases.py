"""Monte Carlo cases of gatherings, each done when one formation set holds all craft, and their statistics."""

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

AT_ONCE = 8192  # number of gatherings in a chunk
ALSO = "delta_v_m_s", "met_unknown", "met_known"  # columns that the tally takes too
CAUSES = {  # columns of delta-v other than for joining, with their labels
    "corrections_m_s": "on corrections against collisions",
    "near_field_m_s": "in the near-field search",
}
KEPT = {  # columns by requirement
    "clear": "clear",
    "delta-v": "delta_v_kept",
    "propellant": "propellant_kept",
    "thrust": "none_adrift",
    "sun": WITHIN_SUN,
}


@dataclass(frozen=True, eq=False)
class GatherCases(Cases):
    """Cases of gatherings with a row each.

    Columns: `duration_s`, `leg`, `rounds`, `left`, `delta_v_m_s`, the numbers of conflicts, and each
    requirement. Where they can occur: the delta-v of corrections and of the near-field search, and for craft
    that may lose their thrust the time of each loss and the number `adrift`. `search` covers all rounds.
    """

    stage: Gather
    search: Search

    @classmethod
    def of(cls, scenario: Scenario, seed: int) -> Self:
        """Return the cases of a scenario that gathers."""
        (stage,) = scenario.stages
        assert isinstance(stage, Gather)
        arguments = scenario.gathering(stage)
        search, _ = all_rounds(scenario.plan, arguments["rounds"], arguments["max_speed"])
        return cls(scenario, seed, stage, search)

    @property
    def at_once(self) -> int:
        """Greatest number of cases in a chunk."""
        return AT_ONCE

    @property
    def causes(self) -> tuple[str, ...]:
        """Those of CAUSES that can occur."""
        near = any(leg.phase == "NFS" for leg in self.search.legs)
        return tuple(compress(CAUSES, (bool(self.scenario.zones.pairs), near)))

    def fly(self, first: int, last: int) -> Columns:
        """Return the results of the gatherings of some cases."""
        scenario = self.scenario
        pairs = np.stack(np.triu_indices(len(scenario.craft), 1), axis=1)
        states = drawn(scenario, self.seed, first, last)
        apart(scenario, states, pairs, first)
        arguments = scenario.gathering(self.stage) | {"errors": searching(scenario, self.seed, first, last)}
        flown, lost = (scenario.plan, states[..., :3], states[..., 3:]), {}
        if FAILS in varied(scenario):
            found, fails = gather_failing(*flown, failures(scenario, self.seed, first, last), **arguments)
            lost = {lost_by(name): fails[:, k] for k, name in enumerate(scenario.names)}
            lost |= {"adrift": found.adrift}
        else:
            found = gather_cases(*flown, **arguments)
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
            **within_sun_limit(scenario, self.search, arguments["errors"], last - first),
        }

    def good(self, columns: Columns) -> Any:
        """Return the cases in which all craft are gathered and all requirements are met."""
        kept = [columns[name] for name in KEPT.values() if name in columns]
        return np.all([columns["leg"] >= 0, *kept], axis=0)

    def stored(self, first: int, last: int, columns: Columns) -> Columns:
        """Return a row for each case, with its phase and round."""
        return super().stored(first, last, columns | ended(self.search, columns["leg"]))

    def campaign(self, chunks: CaseChunks) -> GatherCampaign:
        """Return the statistics of the cases."""
        return GatherCampaign(self, chunks)


@dataclass(frozen=True, eq=False, repr=False)
class GatherCampaign(Campaign):
    """Statistics of gatherings, each done when one formation set holds all craft.

    `rounds` (C,): searches begun; `left` (C,): craft not in the formation set; `delta_v` (C,) of all craft
    together [m/s]; `met_unknown` (C,): pairs that entered their keep-out zone before they knew each other,
    `met_known` (C,): only after.
    """

    kind: GatherCases
    done: ClassVar[str] = "gathered"

    @property
    def wanted(self) -> tuple[str, ...]:
        """Columns with the outcome of a case."""
        return ("duration_s", "leg", *ALSO, *self.kind.causes, *KEPT.values())

    def settled(self, columns: Columns) -> Settled:
        """Return the outcomes of the cases of a chunk."""
        kept = {what: columns[name] for what, name in KEPT.items() if name in columns}
        also = {name: columns[name] for name in (*ALSO, *self.kind.causes)}
        time = columns["duration_s"]
        return Settled(time, columns["leg"], kept, {}, time, also)

    @property
    def measured(self) -> dict[str, Measured]:
        """Quantities of `spreads`."""
        return super().measured | {"delta-v of all craft [m/s]": partial(caused, "delta_v_m_s")}

    @property
    def spent(self) -> dict[str, Measured]:
        """Quantities of `costs`, up to the end of the gathering: by cause, and by the phase of that end."""
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
        """Return one column of all cases."""
        return np.concatenate([part[name] for _, part in self.chunks.read(name)])

    @cached_property
    def rounds(self) -> Any:
        """Number of searches begun."""
        return self.column("rounds")

    @cached_property
    def left(self) -> Any:
        """Number of craft not in the formation set."""
        return self.column("left")

    @property
    def delta_v(self) -> Floats:
        """Delta-v of all craft together [m/s]."""
        spent: Floats = self._settled.also["delta_v_m_s"]
        return spent

    @property
    def met_unknown(self) -> Any:
        """Number of pairs that entered their keep-out zone before they knew each other."""
        return self._settled.also["met_unknown"]

    @property
    def met_known(self) -> Any:
        """Number of pairs that did so only after."""
        return self._settled.also["met_known"]


def caused(name: str, one: Settled) -> tuple[Floats, Any]:
    """Return the delta-v (C,) [m/s] of a column, and which cases are gathered."""
    return one.also[name], one.leg >= 0


def joining(causes: tuple[str, ...], one: Settled) -> tuple[Floats, Any]:
    """Return the delta-v (C,) [m/s] of joining the formation set, and which cases are gathered."""
    rest = one.also["delta_v_m_s"] - sum(one.also[name] for name in causes)
    return np.maximum(rest, 0.0), one.leg >= 0  # rounding can make it negative


def spent_until(search: Search, number: int, one: Settled) -> tuple[Floats, Any]:
    """Return the delta-v (C,) [m/s], and which cases are gathered in a phase, by the index of its label."""
    return one.also["delta_v_m_s"], ended_in(search, one.time, one.leg) == number


def within_limits(scenario: Scenario, flown: Gatherings) -> dict[str, Any]:
    """Return in which gatherings (C,) each clearance and limit that the file requires is kept."""
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
