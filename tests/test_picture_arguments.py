"""Invalid arguments of pictures and studies are named in one line."""

import inspect
import io

import matplotlib as mpl
import numpy as np
import pytest

import closeform as cf
from calls import BALL, COAST, GATHERED, MOVE, REST, SEARCH, STAYS, is_named
from calls import CALLS as OTHERS
from closeform.scenario import ScenarioError
from public_names import CALLABLES

mpl.use("agg")
KNOWN = cf.Uncertainty(np.diag([1.0, 2.0, 1.0, 1e-3, 1e-3, 1e-3]) ** 2)
NEAR = REST.orbit.coast([0.0, 30.0, 0.0, 0.0, 0.0, 0.0], REST.end)
MEETING = cf.collision_probability(NEAR, REST, BALL, cf.Uncertainty(np.eye(6)))
LATER = COAST.orbit.coast(COAST.state(COAST.end.max()), 100.0, COAST.end.max())
CHIEF = cf.Chief.from_elements("2026-11-22T12:00:00", [6.878e6, 0.0, 1e-3, 0.0, 0.9, 0.0])
PAIR = CHIEF.orbit.transfer(
    [[0, 100, 0, 0, 0, 0], [0, 180, 0, 0, 0, 0]], [[0, 0, 50, 0, 0, 0], [50, 80, 0, 0, 0, 0]], 900.0
)
FLOWN = cf.simulate(PAIR, cf.Field(CHIEF), navigation=cf.Navigation(0.1, 3e-4), zones=BALL, seeds=3)
CALLS = {
    "plots.animation": {
        "gathering": GATHERED, "file": io.BytesIO(), "craft": 0, "names": ["a", "b", "c"],
        "frames": 3,
    },
    "plots.before_after": {
        "before": MOVE, "after": MOVE, "obstacles": [REST], "zone": BALL, "names": ["a"],
        "corridor": cf.requirements.ApproachCone(axis=[0, 1, 0], half_angle=0.2, radius=1.0),
    },
    "plots.burns": {"paths": COAST, "names": ["a", "b", "c"]},
    "plots.clearance": OTHERS["plots.clearance"],
    "plots.closest_pairs": {"paths": COAST, "zones": BALL, "names": ["a", "b", "c"], "count": 2},
    "plots.collision": {"found": MEETING, "path": NEAR, "limit": 0.5, "what": "a - b"},
    "plots.distances": {"path": MOVE, "other": REST, "zone": BALL, "names": ["a", "b"]},
    "plots.drift_fan": {"path": MOVE, "other": STAYS, "zone": BALL, "until": 1800.0, "names": ["a", "b"]},
    "plots.drift_ratios": {
        "path": [MOVE], "other": [STAYS], "zone": [BALL], "until": 1800.0, "labels": ["a"],
        "before": (MOVE, STAYS, BALL),
    },
    "plots.flight_deviations": {"flight": FLOWN, "tube": None, "names": ["a", "b"]},
    "plots.flight_paths": {"flight": FLOWN, "names": ["a", "b"]},
    "plots.flight_ratios": {"flight": FLOWN, "zone": BALL, "names": ["a", "b"]},
    "plots.formation_animation": {
        "paths": COAST, "file": io.BytesIO(), "names": ["a", "b", "c"], "zone": BALL, "frames": 3,
    },
    "plots.formation_paths": {
        "before": COAST, "after": COAST, "names": ["a", "b", "c"], "zone": BALL, "obstacles": [REST]
    },
    "plots.formation_thrust": {
        "paths": COAST, "names": ["a", "b", "c"], "limits": np.ones(3), "masses": np.ones(3),
        "on_off": np.ones(3, dtype=bool),
    },
    "plots.distribution": {"values": np.array([1.0, 2.0]), "what": "delta-v [m/s]", "tail": 0.05},
    "plots.sweep": {
        "values": np.array([1.0, 2.0]), "share": np.array([[0.5, 0.6]]), "low": np.array([[0.4, 0.5]]),
        "high": np.array([[0.6, 0.7]]), "what": "range [m]", "names": ["a"],
    },
    "plots.histogram": {"times": np.array([1.0, 2.0]), "search": SEARCH, "bin": 60.0, "what": "pairs lock"},
    "plots.in_plane_search": {"search": SEARCH},
    "plots.manoeuvres": {"search": SEARCH, "number": 1},
    "plots.overview": {
        "stages": [COAST, LATER], "names": ["a", "b", "c"], "zone": BALL, "titles": ["1", "2"],
        "locks": [(1.0, 0, 1)],
    },
    "plots.primer": OTHERS["plots.primer"],
    "plots.trade": OTHERS["plots.trade"],
    "plots.pulses": {**OTHERS["plots.pulses"], "name": "a"},
    "plots.ratio_matrix": {"paths": COAST, "zones": BALL, "names": ["a", "b", "c"]},
    "plots.ratios": {"before": MOVE, "after": MOVE, "obstacles": [REST], "zone": BALL, "names": ["a"]},
    "plots.sigmas": {
        "path": NEAR, "other": REST, "zone": BALL, "errors": KNOWN, "other_errors": None, "asked": 1.0,
        "names": ["a - b"],
    },
    "plots.speed": {"path": MOVE, "limit": cf.requirements.SpeedLimit(limit=1.0)},
    "plots.three_views": {"gathering": GATHERED, "time": 1.0, "craft": 0, "names": ["a", "b", "c"]},
    "plots.thrust": {"paths": [MOVE], "labels": ["a"], "mass": 1.0},
    "plots.tube": {
        "path": NEAR, "other": REST, "zone": BALL, "errors": KNOWN, "other_errors": None, "sigmas": 1.0,
        "names": ["a", "b"],
    },
    "plots.two_ways": {"path": MOVE, "obstacle": REST, "zone": BALL, "ways": [MOVE], "name": "a"},
    "run": {"file": "examples/cluster.toml"},
    "study": {"file": "examples/s04.toml", "cases": 10, "seed": 1},
}  # fmt: skip
BAD = {"words": "three", "an object": object(), "an array": np.ones((2, 1, 5))}


def call(name, /, **arguments):
    owner, _, function = name.rpartition(".")
    return getattr(cf.plots if owner else cf, function)(**arguments)


@pytest.mark.parametrize("name", CALLS)
def test_invalid_arguments_are_named(name):
    for argument, good in CALLS[name].items():
        for kind, bad in BAD.items():
            if isinstance(bad, str) and (isinstance(good, str) or argument == "file"):
                continue
            with pytest.raises(ValueError) as caught:  # noqa: PT011, the message is checked below
                call(name, **{**CALLS[name], argument: bad})
            assert is_named(argument, caught.value), (argument, kind)
            assert type(caught.value) in (ValueError, ScenarioError)


def test_all_pictures_are_called():
    named = {name for name in CALLABLES if name.startswith("plots.")} | {"run", "study"}
    assert named == CALLS.keys()
    for name, arguments in CALLS.items():
        assert list(arguments) == list(inspect.signature(CALLABLES[name]).parameters)
