"""Spacecraft without engines: they drift in the field, and margins cover that."""

import json
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

import closeform as cf
from closeform.campaign import case_of
from closeform.cli.app import main
from closeform.mission.mission import plan_mission
from closeform.scenario import parse
from closeform.scenario.table import ScenarioError
from drifting_formation import ENDS, OFF, OWN, SPAN, START, drifted
from simulated import FIELD, ORBIT, SIGHT

pytestmark = pytest.mark.usefixtures("undrawn")

DEBRIS = np.array([300.0, -50.0, 20.0, 0.0, 0.05, 0.3])
ZONE = cf.Sphere(20.0)
KINDS = {
    "thrust that lasts": ("transfer", {}),
    "thrust as commanded": ("transfer", {"control": "open"}),
    "impulses": ("two_impulse", {}),
    "pulses": ("transfer", {"thrusters": [OWN, None, None]}),
    "new plans": ("transfer", {"control": "replan", "zones": ZONE}),
}
CLIENT = """\
closeform = 1
title = "An inspector passes a dead client"

[orbit]
epoch = "2026-11-22T12:00:00Z"
field = {{ zonals = 2 }}

[orbit.chief.elements]
semi_major_axis = "6878 km"
eccentricity = 0.001
inclination = "51.6 deg"
latitude = "40 deg"

[craft]
name = ["Inspector", "Client"]
position = ["0 900 0 m", "0 1000 0 m"]
velocity = "0 0 0 m/s"
keep_out = {{ sphere = "20 m" }}
{craft}

[[stage]]
do = "coast"
for = "1 orbit"

[[stage]]
do = "avoid"
craft = "Inspector"
to = {{ position = "0 1100 0 m", velocity = "0 0 0 m/s" }}
within = "0.12 orbits"
{stage}

[navigation]
position = "10 cm"
velocity = "0.3 mm/s"
"""
DEAD = "engine = [true, false]"


def among(make: str) -> cf.Path:
    """Return paths of two moving spacecraft with a coasting one between them."""
    moving = getattr(ORBIT, make)(START[[0, 2]], ENDS[[0, 2]], SPAN)
    return together(moving[0], ORBIT.coast(DEBRIS, SPAN), moving[1])


def together(*paths: cf.Path) -> cf.Path:
    """Return single paths as a batch."""
    counts = [len(one.arcs) for one in paths]
    arcs = np.vstack([one.arcs for one in paths])
    return cf.Path(ORBIT, arcs, np.concatenate([[0], np.cumsum(counts)]), (len(paths),))


@pytest.mark.parametrize("kind", KINDS)
def test_spacecraft_without_engine_drift(kind):
    """The drift agrees with DOP853 and costs nothing; other spacecraft are unaffected."""
    make, options = KINDS[kind]
    path, options = among(make), options | {"navigation": SIGHT, "thrust_error": OFF, "seeds": 2}
    found = cf.simulate(path, FIELD, engine=[True, False, True], **options)
    want = drifted(0.0, DEBRIS, SPAN)
    assert found.states[:, 1, -1, :3] == pytest.approx(np.array([want, want]), abs=1e-3)
    assert np.linalg.norm(want - path.position(SPAN)[1]) > 10.0  # m; Hill's drift differs
    assert not found.delta_v[:, 1].any()
    assert not found.planned_delta_v[1] + abs(found.field_delta_v[1])
    assert not found.limited.any()
    if "replan" not in options.values():
        held = cf.simulate(path, FIELD, **options)
        apart = np.linalg.norm((found.states - held.states)[:, [0, 2], :, :3], axis=-1)
        assert apart.max() < 1e-6
        assert kind == "impulses" or held.delta_v[:, 1].min() > 0.01


def test_sampled_starts_drift():
    """Sampled start states drift as by DOP853; execution errors have no effect."""
    off = cf.Uncertainty(np.diag([3.0, 6.0, 3.0, 2e-3, 2e-3, 2e-3]) ** 2, magnitude=0.05, pointing=0.05)
    path = ORBIT.coast(DEBRIS, SPAN)
    found = cf.simulate(path, FIELD, navigation=SIGHT, errors=off, seeds=3, engine=False)
    for flight in found.states[:, 0]:
        assert flight[-1, :3] == pytest.approx(drifted(0.0, flight[0], SPAN), abs=1e-3)
    assert np.linalg.norm(found.states[:, 0, 0, :3] - DEBRIS[:3], axis=-1).min() > 1.0
    assert not found.delta_v.any()


def test_margins_follow_the_drift():
    """The shift of the margin agrees with DOP853."""
    path = among("transfer")
    found = cf.tracking_margins(path, FIELD, navigation=SIGHT, thrust_error=OFF, engine=[True, False, True])
    for k in (60, len(found.times) - 1):
        want = drifted(0.0, DEBRIS, found.times[k]) - path.position(found.times[k])[1]
        assert found.shift[1, k] == pytest.approx(want, abs=5e-3)
    assert found.noise[1] == found.thrust[1] == found.rest[1] == 0.0
    held = cf.tracking_margins(path, FIELD, navigation=SIGHT, thrust_error=OFF)
    assert found.greatest[[0, 2]] == pytest.approx(held.greatest[[0, 2]], rel=1e-12)


def test_unknown_drag_and_sampled_starts():
    """Unknown drag stays within `rest`, and sampled starts have the covariance `spread`."""
    path = ORBIT.coast(DEBRIS, SPAN)
    air = cf.Drag(5.2e-13, 500e3, 60e3, ballistic=0.05, chief=0.0)
    dragged = cf.simulate(path, cf.Field(FIELD.chief, drag=air), known=FIELD, engine=False)
    free = cf.simulate(path, FIELD, engine=False)
    origin = FIELD.chief_states(np.linspace(0.0, SPAN, 50))
    with_air, without = (cf.Field(FIELD.chief, drag=one) for one in (air, None))
    pushed = with_air.accelerations(0.0, origin, 0.05) - without.accelerations(0.0, origin)
    most = 1.05 * np.linalg.norm(pushed, axis=-1).max()  # of the chief, and its craft some 300 m off
    room = cf.tracking_margins(path, FIELD, residual=most, engine=False)
    off = np.linalg.norm((dragged.states - free.states)[0, 0, :, :3], axis=-1).max()
    assert 0.3 * room.rest[0] < off < room.rest[0]
    errors = cf.Uncertainty(np.diag([3.0, 6.0, 3.0, 2e-3, 2e-3, 2e-3]) ** 2)
    wide = cf.tracking_margins(path, FIELD, errors=errors, engine=False)
    many = cf.simulate(path, FIELD, errors=errors, seeds=400, engine=False)
    spread = np.cov((many.states - free.states)[:, 0, -1, :3].T)
    sizes = (np.sqrt(np.linalg.eigvalsh(one)) for one in (spread, wide.spread[0, -1]))
    assert next(sizes) == pytest.approx(next(sizes), rel=0.15)  # of 400: 4 sigmas of 1 / sqrt(2 * 400)


def test_fitted_margin_covers_the_drift():
    """A client drifts 36 m into the path of a passing spacecraft.

    The margin for a held client is violated, and the margin for a drifting one is not.
    """
    begin, over = ORBIT.period, 1.12 * ORBIT.period
    first = np.array([[0.0, 2900.0, 0, 0, 0, 0], [0.0, 3000.0, 0, 0, 0, 0]])
    held, drifts = ORBIT.coast(first, begin), FIELD.coast(first[1], over, orbit=ORBIT)
    after = FIELD.coast(drifts.state(begin), over - begin, begin, orbit=ORBIT)
    direct = ORBIT.transfer(held.state(begin)[0], [0, 3100.0, -4.0, 0, 0, 0], over - begin, begin)
    client, found = ORBIT.coast(first[1], over - begin, begin), {}
    for name, there, before, engine in (
        ("held", client, held, True),
        ("drifting", client, held, False),
        ("where it is", after, None, False),
    ):
        plan = cf.fit_margin(
            lambda margin, there=there: cf.avoid(direct, there, ZONE, margin=margin),
            *(FIELD, ZONE),
            navigation=SIGHT,
            obstacles=there,
            held=True,
            before=before,
            engine=[True, engine],
        )
        assert plan.fits
        both = together(cf.join([held[0], plan.plan.path]), drifts)
        options = {"navigation": SIGHT, "zones": ZONE, "engine": [True, False]}
        flights = cf.simulate(both, FIELD, seeds=20, **options)
        assert flights.ends[:, 1].max() < 5e-3  # natural motion
        found[name] = plan.greatest, flights.violated
    assert found["held"][1] == 1.0
    assert found["drifting"][1] == found["where it is"][1] == 0.0
    assert found["drifting"][0] > 30.0
    assert found["where it is"][0] < 1.01 * found["held"][0]


def test_spacecraft_without_engine_have_no_commands():
    path = among("transfer")
    table = cf.compensated_thrust(path, FIELD, engine=[True, False, True])
    held = cf.compensated_thrust(path, FIELD)
    assert not table.commanded[1].any()
    assert not table.delta_v[1]
    assert held.delta_v[1] > 0.01
    assert table.delta_v[[0, 2]] == pytest.approx(held.delta_v[[0, 2]], rel=1e-12)
    want = drifted(0.0, DEBRIS, SPAN)
    assert table.path.position(SPAN)[1] == pytest.approx(want, abs=2e-3)  # coasts are sampled to 1 mm
    assert table.deviation[1] >= np.linalg.norm(want - path.position(SPAN)[1]) - 2e-3


def test_run_with_a_dead_client(tmp_path: Path, capsys):
    """The client drifts through both stages without commands."""
    file = tmp_path / "client.toml"
    file.write_text(CLIENT.format(craft=DEAD, stage='margin = "auto"') + "\n[simulation]\nseeds = 5\n")
    out = str(tmp_path / "out")
    assert main(["run", str(file), "--out", out, "--no-viewer"]) == 0
    assert "No engine: Client" in capsys.readouterr().out
    options = json.loads((tmp_path / "out" / "summary.json").read_text())["flights"]
    mission = cf.load(tmp_path / "out")
    path = mission.paths[1]
    for number, stage in enumerate(mission.results, 1):
        want = _drift(mission.scenario, path, stage.end)
        row = next(one for one in options["stages"] if one["number"] == number)
        assert row["end_most_m"] == pytest.approx(want, abs=1e-3)
    assert next(one for one in options["spent"] if one["craft"] == "Client")["delta_v_m_s"] == 0.0
    flown_out = str(tmp_path / "flown")
    assert main(["simulate", out, "--out", flown_out, "--seeds", "3", "--no-viewer"][:-1]) == 0
    rows = pyarrow.parquet.read_table(Path(flown_out) / "commanded.parquet").to_pydict()
    sizes = np.array([rows[key] for key in ("ux_m_s2", "uy_m_s2", "uz_m_s2")]).T
    idle = np.array(rows["craft"]) == "Client"
    assert not sizes[idle].any()
    assert sizes[~idle].any()


def _drift(scenario, path: cf.Path, time: float) -> float:
    """Return the distance of a drifting spacecraft from its path by DOP853."""
    return float(np.linalg.norm(drifted(0.0, path.state(0.0), time, scenario.field) - path.position(time)))


def test_automatic_margin_covers_the_drift():
    """The margin of a drifting client is larger, and no simulation violates it."""
    missions = {
        engine: plan_mission(
            parse(CLIENT.format(craft=craft, stage='margin = "auto"') + "\n[simulation]\nseeds = 20\n")
        )
        for engine, craft in ((True, ""), (False, DEAD))
    }
    margins = {key: one.results[1].result.plan.padding for key, one in missions.items()}
    drift = _drift(missions[False].scenario, missions[False].paths[1], missions[False].results[1].end)
    assert margins[False] > margins[True] + 0.2 * drift
    assert missions[False].flights.flight.violated == 0.0
    assert missions[False].flights.flight.ends[:, 1] == pytest.approx(drift, abs=1e-3)


def test_dead_client_in_a_study():
    draws = (
        "\n[simulation]\n\n[study]\ncases = 3\nseed = 1\n\n"
        '[study.vary]\n"craft.position" = { normal = "5 m" }\n'
    )
    text = CLIENT.format(craft=DEAD, stage="") + draws
    for case in range(3):
        mission = plan_mission(case_of(parse(text), case))
        flight = mission.flights.flight
        drift = _drift(mission.scenario.truth, mission.paths[1], mission.results[1].end)
        assert flight.ends[0, 1] == pytest.approx(drift, abs=1e-3)
        assert flight.delta_v[0, 1] == 0.0


@pytest.mark.parametrize(
    ("was", "becomes", "line"),
    [
        (
            'craft = "Inspector"\n',
            'craft = "Client"\n',
            "stage[2].craft: Client has no engine; name another craft, or remove engine",
        ),
        (
            'do = "coast"\nfor = "1 orbit"',
            'do = "scatter"\nfactor = 2.0\nwithin = "1 orbit"',
            "stage[1].do: scatter moves all craft, and Client has no engine; use reconfigure with craft",
        ),
    ],
)
def test_moves_without_an_engine_are_refused(was: str, becomes: str, line: str):
    text = CLIENT.format(craft=DEAD, stage="")
    assert was in text
    with pytest.raises(ScenarioError) as error:
        parse(text.replace(was, becomes))
    assert any(one.startswith(f"scenario: {line}") for one in error.value.lines)


def test_invalid_engines():
    path = among("transfer")
    with pytest.raises(ValueError, match=r"^engine: expected True or False, or one for each of 3 craft, got"):
        cf.simulate(path, FIELD, engine=[True, False])
    with pytest.raises(ValueError, match=r"^engine: craft 0 has none, but its path thrusts; give its"):
        cf.tracking_margins(path, FIELD, engine=False)
    with pytest.raises(ValueError, match=r"^thrusters: craft 1 has no engine; give None for it$"):
        cf.simulate(path, FIELD, thrusters=OWN, engine=[True, False, True])
    with pytest.raises(ValueError, match=r"^engine: expected True or False"):
        cf.compensated_thrust(path, FIELD, engine=0.0)
