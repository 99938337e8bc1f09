"""Reproduce the figures and numbers of the three source papers.

    python examples/papers.py sp11            # or s04, or h03; default: all three, into "papers-results"

Each prints the paper's numbers beside closeform's, and saves a picture of each figure. docs/papers.md has the
references, and the items in which results differ.
"""

import sys
from pathlib import Path
from timeit import repeat

import numpy as np
import paper_figures as figures

import closeform as cf

HERE = Path(__file__).parent
FOLDER = Path("papers-results")
DEGREE = np.pi / 180
COLUMNS = "{:<52} {:>16} {:>16}"


def main() -> None:
    """Reproduce the papers that the command line names."""
    FOLDER.mkdir(exist_ok=True)
    for name in sys.argv[1:] or list(PAPERS):
        print(COLUMNS.format(name.upper(), "paper", "closeform"))
        PAPERS[name]()


def row(what: str, paper: str, ours: str) -> None:
    """Print one number of a paper."""
    print(COLUMNS.format(what, paper, ours))


def saved(**pictures) -> None:
    """Save pictures by name."""
    for name, figure in pictures.items():
        figure.savefig(FOLDER / f"{name}.png")


def seconds(call) -> float:
    """Return the shortest time of a call [s]."""
    call()  # compiles
    return min(repeat(call, number=1, repeat=20))


def sp11() -> None:
    """Conflicts and one shaped path: Sauter and Palmer 2011, section 5."""
    mission = cf.run(HERE / "sp11.toml")
    stage = mission.results[0]
    mover, other = stage.before.path("MOVER"), stage.before.path("OTHER")
    shaped, zone = stage.after.path("MOVER"), mission.scenario.zones.between(0, 1)
    method = {"method": "sauter-palmer"}
    coasts = [mover.orbit.coast(path.state(0.0), path.end) for path in (mover, other)]
    times = [
        seconds(lambda: cf.find_conflicts(*coasts, zone, **method)),
        seconds(lambda: cf.find_conflicts(mover, other, zone, **method)),
        seconds(lambda: cf.avoid(mover, other, zone, **method)),
    ]
    row("conflicts of two coasting spacecraft, by its method", "0.0002 s", f"{times[0]:.6f} s")
    row("conflicts on optimal paths, by its method", "0.0067 s", f"{times[1]:.6f} s")
    row("conflict found and path shaped, by its method", "0.04 s", f"{times[2]:.4f} s")
    exact = cf.avoid(mover, other, zone)
    row(
        "more energy than the minimum around the obstacle",
        "0 (optimal)",
        f"{shaped.energy / exact.energy - 1:.2%}",
    )
    saved(
        sp11_figure_1=cf.plots.distances(mover, other, zone, ["mover", "other"]),
        sp11_figure_2=cf.plots.two_ways(mover, other, zone),
        sp11_figure_3=cf.plots.before_after(mover, shaped, [other], zone, ["other"]),
    )


def s04() -> None:
    """Guaranteed search for pairs: Scharf, Ploen, Hadaegh and Sohl 2004."""
    search = cf.Search.modified(cf.Sensor(70 * DEGREE), slew_rate=0.25 * DEGREE, sun_limit=25 * DEGREE)
    row("tip angle, equation 1", "21.3 deg", f"{search.tip_angle / DEGREE:.1f} deg")
    row("sky covered by the IPS", "94 %", f"{search.coverage('IPS'):.1%}")
    row("duration of the search", "about 2.4 h", f"{search.duration / 3600:.2f} h")
    study = cf.study(HERE / "s04.toml")
    shares = {share.label: share for share in study.shares}
    row("150 000 pairs: lock at once", "33.37 %", f"{shares['at once'].by_end.share:.2%}")
    row("lock by the end of the first IPS", "97.33 %", f"{shares['IPS 1'].by_end.share:.2%}")
    row("lock in the first mOPS", "2.65 %", f"{shares['mOPS 1'].inside.share:.2%}")
    row("lock in the second IPS", "37", f"{shares['IPS 2'].cases}")
    row("lock in the second mOPS; never", "0; 0", f"{shares['mOPS 2'].cases}; {shares['never'].cases}")
    counterexample = [2.08, 25.2, -305.6], [0, 0, 0.0831]
    case = cf.papers.theorem_case(search, *counterexample)
    row(
        "pair that needs the second mOPS",
        "second mOPS",
        f"{case.phase[0]} {case.phase[1]}, {case.time:.0f} s",
    )
    margins = cf.lock_margins(search, *counterexample)
    row("radius of states with the same outcome", "not zero", f"{margins.position:.3f} m")
    narrow, turned = cf.Sensor(35 * DEGREE), np.array([20, 190, -75]) * DEGREE
    saved(
        s04_figure_1=figures.simultaneity(narrow, [[0, 0], [100, 30], [40, 110]], turned),
        s04_figure_2=figures.spacecraft(search, shade=15.0),
        s04_figure_3=cf.plots.in_plane_search(search),
        s04_figure_4=cf.plots.manoeuvres(search),
        s04_figure_5=figures.complementary_cones(search),
        s04_figure_6=figures.lemma_2(search, [-100.0, 240.0, 170.0], [-0.05, -0.10, 0.03]),
        s04_figure_7=cf.plots.histogram(study.time, search),
        s04_counterexample=figures.lock_map(search, *counterexample, reach=3.0),
    )


def h03() -> None:
    """Five lost spacecraft gather: Hadaegh, Scharf and Ploen 2003, section V."""
    mission = cf.run(HERE / "tpf.toml")
    gathering, names = mission.results[0].result, mission.scenario.names
    search, once = (
        mission.scenario.plan,
        cf.Search.basic(
            cf.Sensor(70 * DEGREE, offset=7.5), 0.25 * DEGREE, 25 * DEGREE, in_plane_turn=2 * np.pi, passes=1
        ),
    )
    row("IPS of one revolution ends", "24 min", f"{search.legs[0].end / 60:.0f} min")
    row(
        "near field: radius, length",
        "7 m, 80 m",
        f"{search.near_field_radius(3.17):.1f} m, {search.near_field:.0f} m",
    )
    locks = [event for event in gathering.events if event.kind == "lock"]
    for paper, event in zip(("12 min", "14 min", "16 min", "28 min 40 s"), locks, strict=True):
        row(
            f"lock of {names[event.first]} and {names[event.second]}, case {event.case}",
            paper,
            f"{event.time:.1f} s",
        )
    arguments = mission.scenario.gathering(mission.scenario.stages[0])
    states = mission.scenario.states(mission.scenario.orbit.build())
    at_1_hz = cf.gather(once, states[:, :3], states[:, 3:], **arguments | {"rounds": 1, "step": 1.0})
    row("gathered in one pass, with detection at 1 Hz", "about 29 min", f"{at_1_hz.duration / 60:.1f} min")
    study = cf.study(HERE / "h03.toml", cases=20_000)
    first = next(share for share in study.shares if share.label == "IPS 1")
    row("20 000 cases: gathered in the first IPS", "typically", f"{first.by_end.share:.1%}")
    row("never gathered", "no failures", f"{study.shares[-1].cases}")
    ahead = np.array([50, 170]) * DEGREE
    places = [[0, 0], [10, 140], [70, 60], [190, 110], [230, 20]]  # three in group A, two in B
    saved(
        h03_figure_1=figures.simultaneity(search.sensor, [[0, 0], [100, 30]], ahead),
        h03_figure_2=figures.spacecraft(search, shade=15.0),
        h03_figure_3=figures.simultaneity(search.sensor, places, np.array([0, 0, 0, 180, 180]) * DEGREE),
        h03_figure_4=cf.plots.in_plane_search(search),
        h03_figure_5=cf.plots.manoeuvres(search),
        h03_figure_6=figures.near_field(search),
        h03_figure_7=figures.sets(gathering, 1000.0, names),
        h03_figure_8=figures.join_table(gathering),
        h03_figure_9=cf.plots.three_views(gathering, 720.0, names=names),
        h03_figure_10=cf.plots.three_views(gathering, 960.0, names=names),
        h03_figure_11=cf.plots.three_views(gathering, gathering.duration, names=names),
    )


PAPERS = {"sp11": sp11, "s04": s04, "h03": h03}

if __name__ == "__main__":
    main()
