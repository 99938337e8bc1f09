"""A run's result folder: summary, tables, pictures and one self-contained HTML page."""

import base64
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from closeform.chapters import Chapter, Sheet, chapters, opening, verdict
from closeform.flight import Flight
from closeform.mission import Leg, Mission
from closeform.results import REPORT, Folder

SAMPLES = 201  # instants of each craft and stage in paths.parquet
STATE_COLUMNS = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s")
THRUST_COLUMNS = ("ux_m_s2", "uy_m_s2", "uz_m_s2")

STYLE = """
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fdfdfc; --faint: #667; --line: #d5d8dc;
  --card: #f3f4f5; --good: #1a7f5a; --bad: #b3421e; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ea; --paper: #16191d; --faint: #9aa3ad;
  --line: #363c44; --card: #1f2429; --good: #5bc49a; --bad: #f0926b; } }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 62rem; margin: 0 auto; padding: 2rem 1.2rem 4rem; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; } h2 { font-size: 1.2rem; margin: 2.4rem 0 .4rem;
  border-top: 1px solid var(--line); padding-top: 1.2rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; } p { margin: .35rem 0; } .faint { color: var(--faint); }
.verdict { display: inline-block; padding: .3rem .8rem; border-radius: .4rem; background: var(--card);
  font-weight: 600; margin: .8rem 0 0; } .good { color: var(--good); } .bad { color: var(--bad); }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .2rem .9rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; color: var(--faint); }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
img { max-width: 100%; background: #fff; border-radius: .4rem; padding: .4rem; box-sizing: border-box; }
figure { margin: 1rem 0; } figcaption { color: var(--faint); font-size: .92rem; }
summary { cursor: pointer; margin: 1rem 0 .3rem; font-weight: 600; }
"""


def leave(mission: Mission, folder: Folder) -> None:
    """Fill a result folder with everything that a run leaves."""
    folder.text("scenario.toml", mission.scenario.text)
    folder.table("conflicts", conflict_table(mission))
    folder.table("approaches", approach_table(mission))
    folder.table("paths", path_table(mission))
    folder.table("craft", craft_table(mission))
    shown = {leg.number: pictures(leg, folder) for leg in mission.legs}
    folder.summary(summary(mission))
    folder.text(REPORT, page(mission, shown))


def summary(mission: Mission) -> dict[str, Any]:
    """Every figure printed, in full."""
    scenario = mission.scenario
    return {
        "title": scenario.title,
        "inputs": {Path(scenario.file).name: f"sha256:{scenario.digest}"},
        "seed": None,
        "status": 0 if mission.clear else 1,
        "verdict": verdict(mission),
        "warnings": list(mission.warnings),
        "mean_motion_rad_s": mission.orbit.mean_motion,
        "craft": list(scenario.names),
        "stages": [leg_summary(leg) for leg in mission.legs],
    }


def leg_summary(leg: Leg) -> dict[str, Any]:
    """One stage."""
    figures: dict[str, Any] = {
        "number": leg.number,
        "name": leg.name or None,
        "do": leg.verb,
        "start_s": leg.start,
        "end_s": leg.end,
        "before": flight_summary(leg.before),
        "after": flight_summary(leg.after),
    }
    if leg.change is not None:
        avoidance = leg.change.avoidance
        around = path_summary(avoidance.path) if avoidance.path is not None else None
        figures["change"] = {
            "craft": leg.change.craft,
            "method": leg.change.method,
            "ok": avoidance.ok,
            "status": str(avoidance.status),
            "reason": avoidance.reason,
            "extra_energy_m2_s3": avoidance.extra_energy,
            "proven": avoidance.proven,
            "exhausted": avoidance.exhausted,
            "tried": avoidance.tried,
            "contacts": [
                {
                    "craft": leg.change.others[at.obstacle],
                    "time_s": at.time,
                    "position_m": at.position.tolist(),
                }
                for at in avoidance.contacts
            ],
            "direct": path_summary(leg.change.direct),
            "around": around,
        }
    return figures


def path_summary(path: Any) -> dict[str, float]:
    """What one path costs."""
    return {
        "energy_m2_s3": path.energy,
        "delta_v_m_s": path.delta_v,
        "peak_thrust_m_s2": path.peak_thrust,
    }


def flight_summary(flight: Flight) -> dict[str, Any]:
    """Conflicts and the closest pair."""
    close = flight.closest
    return {
        "conflicts": [
            {
                "pair": [met.first, met.second],
                "start_s": met.conflict.start,
                "end_s": met.conflict.end,
                "time_s": met.conflict.time,
                "ratio": met.conflict.ratio,
            }
            for met in flight.encounters
        ],
        "closest": None
        if close is None
        else {
            "pair": [close.first, close.second],
            "time_s": close.approach.time,
            "ratio": close.approach.ratio,
            "distance_m": close.approach.distance,
        },
    }


def flights(mission: Mission) -> Iterator[tuple[Leg, str, Flight]]:
    """Every stage's flight before avoidance and after it."""
    for leg in mission.legs:
        yield leg, "before", leg.before
        yield leg, "after", leg.after


def columns(names: tuple[str, ...], rows: list[tuple[Any, ...]]) -> dict[str, list[Any]]:
    """Rows as columns; also without any row."""
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def conflict_table(mission: Mission) -> dict[str, list[Any]]:
    """Every conflict of every stage, before and after avoidance."""
    rows = [
        (
            leg.number,
            when,
            met.first,
            met.second,
            *(getattr(met.conflict, key) for key in ("start", "end")),
            met.conflict.time,
            met.conflict.ratio,
        )
        for leg, when, flight in flights(mission)
        for met in flight.encounters
    ]
    return columns(("stage", "when", "first", "second", "start_s", "end_s", "time_s", "ratio"), rows)


def approach_table(mission: Mission) -> dict[str, list[Any]]:
    """Every pair's closest approach in every stage, before and after avoidance."""
    rows = [
        (
            leg.number,
            when,
            pair.first,
            pair.second,
            pair.approach.time,
            pair.approach.ratio,
            pair.approach.distance,
        )
        for leg, when, flight in flights(mission)
        for pair in flight.nearest
    ]
    return columns(("stage", "when", "first", "second", "time_s", "ratio", "distance_m"), rows)


def craft_table(mission: Mission) -> dict[str, list[Any]]:
    """What every craft spends in every stage as flown."""
    rows = [
        (leg.number, name, *path_summary(leg.after.paths[k]).values())
        for leg in mission.legs
        for k, name in enumerate(mission.scenario.names)
    ]
    return columns(("stage", "craft", "energy_m2_s3", "delta_v_m_s", "peak_thrust_m_s2"), rows)


def path_table(mission: Mission) -> dict[str, Any]:
    """States and thrusts as flown, at equal steps of every stage, to look at and to plot."""
    names = np.array(mission.scenario.names)
    parts: list[dict[str, Any]] = []
    for leg in mission.legs:
        times = np.linspace(leg.start, leg.end, SAMPLES)
        states, thrusts = leg.after.paths.state(times), leg.after.paths.thrust(times)
        parts.append(
            {
                "stage": np.full(len(names) * SAMPLES, leg.number),
                "craft": np.repeat(names, SAMPLES),
                "time_s": np.tile(times, len(names)),
                **dict(zip(STATE_COLUMNS, states.reshape(-1, 6).T, strict=True)),
                **dict(zip(THRUST_COLUMNS, thrusts.reshape(-1, 3).T, strict=True)),
            }
        )
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


def pictures(leg: Leg, folder: Folder) -> list[tuple[Path, str]]:
    """The pictures of a stage with their captions."""
    return [
        (folder.picture(f"stage-{leg.number}-{name}", figure), caption)
        for name, figure, caption in figures(leg)
    ]


def figures(leg: Leg) -> Iterator[tuple[str, Any, str]]:
    """Name, figure and caption of every picture of a stage."""
    from closeform import plots

    mover = leg.change.craft if leg.change is not None else None
    pairs = [pair for pair in leg.before.nearest if mover in (None, pair.first, pair.second)]
    if not pairs or (leg.change is None and not leg.after.encounters):
        return
    close = min(pairs, key=lambda pair: pair.approach.ratio)
    one = mover or close.first
    other = close.second if one == close.first else close.first
    path = leg.before.path(one) if leg.change is None else leg.change.direct
    obstacle = leg.before.path(other)
    yield "distances", plots.distances(path, obstacle, close.zone), f"{one} relative to {other}, before"
    if leg.change is None:
        return
    met = [name for name, zone in zip(leg.change.others, leg.change.zones, strict=True) if zone is close.zone]
    others = [leg.before.path(name) for name in met]
    around = leg.change.avoidance.path
    if leg.before.encounters:
        caption = f"Two ways of {one} around {other}"
        yield "two-ways", plots.two_ways(path, obstacle, close.zone), caption
    if around is None or around is path:
        return
    caption = f"The path of {one} before and after"
    yield "before-after", plots.before_after(path, around, others, close.zone, names=met), caption
    caption = f"How near {one} comes to the zones of the others, before and after"
    yield "nearness", plots.ratios(path, around, others, close.zone, names=met), caption
    yield "thrust", plots.thrust([path, around], ["before", "after"]), f"Thrust of {one}"


def page(mission: Mission, shown: dict[int, list[tuple[Path, str]]]) -> str:
    """The whole report as one HTML page without references to other files."""
    tone = "good" if mission.clear else "bad"
    title = escape(mission.scenario.title)
    parts = [
        f"<h1>{title}</h1>",
        f'<p class="faint">{escape(opening(mission))}; {escape(Path(mission.scenario.file).name)}</p>',
        f'<p class="verdict {tone}">{escape(verdict(mission))}</p>',
        *(f'<p class="bad">{escape(line)}</p>' for line in mission.warnings),
    ]
    for leg, chapter in zip(mission.legs, chapters(mission), strict=True):
        parts += section(chapter, shown[leg.number])
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}</title><style>{STYLE}</style></head>\n<body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def section(chapter: Chapter, shown: list[tuple[Path, str]]) -> Iterator[str]:
    """One stage."""
    yield f"<h2>{escape(chapter.title)}</h2>"
    yield from (f"<p>{escape(line)}</p>" for line in chapter.lines)
    yield from (f"<h3>{escape(sheet.title)}</h3>{table(sheet)}" for sheet in chapter.sheets if not sheet.more)
    yield from (f"<p>{escape(line)}</p>" for line in chapter.closing)
    for file, caption in shown:
        data = base64.b64encode(file.read_bytes()).decode()
        text = escape(caption)
        yield f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        yield f"<figcaption>{text}</figcaption></figure>"
    for sheet in chapter.sheets:
        if sheet.more:
            yield f"<details><summary>{escape(sheet.title)}</summary>{table(sheet)}</details>"


def table(sheet: Sheet) -> str:
    """A sheet as an HTML table."""
    head = "".join(f"<th>{escape(column)}</th>" for column in sheet.columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in sheet.rows
    )
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'
