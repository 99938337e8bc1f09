"""Arguments of public functions: memory layouts that are accepted, and messages for invalid values.

`CALLS` has a valid call of each function, and "name, variant" one with other arguments.  Tests repeat them
with the same numbers in other layouts, and with one invalid argument, which the message must name.
"""

import inspect
import tempfile
from copy import copy
from dataclasses import fields, is_dataclass
from enum import Enum

import matplotlib as mpl
import numpy as np
import pytest

import closeform as cf
from calls import BALL, CALLS, COAST, LOW, MEETING, ORBIT, SEARCH, SIX, START, TABLE, is_named
from public_names import CALLABLES, RESULTS

mpl.use("agg")


def parameter(name, argument):
    """Return the parameter of a call's function, or of the function to which it passes keywords."""
    taken = inspect.signature(CALLABLES[name.partition(",")[0]]).parameters
    passed_on = cf.tracking_margins if "tracking" in taken else cf.Uncertainty
    return taken[argument] if argument in taken else inspect.signature(passed_on).parameters[argument]


def call(name, /, **changed):
    owner, _, method = name.partition(",")[0].rpartition(".")
    arguments = {**CALLS[name], **changed}
    if "self" in arguments:
        return getattr(arguments.pop("self"), method)(**arguments)
    return (getattr(getattr(cf, owner), method) if owner else getattr(cf, method))(**arguments)


BAD = {"words": "three", "an object": object()}
UNKNOWN = {  # arguments that may be nan, of which nothing is then known
    ("Path", "arcs"),
    ("Search.near_field_radius", "height"),
    ("papers.cone_regions", "position"),
    ("Gathering.known", "time"),
}
# arguments that may be negative, and that may be infinite
SIGNED = {"altitude", "along_track", "argument_of_perigee", "first_phase", "inclination", "j2", "latitude"}
SIGNED |= {"phase", "spin", "start", "time", "true_anomaly", "until"}
ENDLESS = {"gap", "interpolate", "max_acceleration", "prove", "range", "slew_acceleration", "time", "until"}
SHAPED = np.ones((2, 1, 1, 1, 5))  # valid only where any shape is


@pytest.mark.parametrize("name", CALLS)
def test_invalid_arguments_are_named(name):
    """Messages name the invalid argument; numbers that broadcast are valid."""
    for argument, good in CALLS[name].items():
        if argument == "self":
            continue
        taken = parameter(name, argument)
        free = taken.default is inspect.Parameter.empty or taken.annotation in ("str", "str | None")
        bads = dict(BAD)
        numeric = isinstance(good, float) or (isinstance(good, np.ndarray) and good.dtype == float)
        if numeric and (name, argument) not in UNKNOWN:
            bads["not finite"] = np.full(np.shape(good), np.nan)[()]
        if isinstance(good, float) and argument not in SIGNED:
            bads["negative"] = -1.0 - good
        if isinstance(good, float) and argument not in ENDLESS:
            bads["infinite"] = np.inf
        for kind, bad in bads.items():
            if not (isinstance(good, str) and isinstance(bad, str) and free):
                with pytest.raises((ValueError, TypeError)) as caught:
                    call(name, **{argument: bad})
                assert is_named(argument, caught.value), (argument, kind)
        try:
            call(name, **{argument: SHAPED})
        except (ValueError, TypeError) as error:
            if not is_named(argument, error):
                raise


@pytest.mark.parametrize("argument", ["file", "ephemeris", "originator", "comments"])
def test_invalid_arguments_of_ephemeris_files_are_named(argument, tmp_path):
    good = {"file": tmp_path / "a.oem", "ephemeris": TABLE, "originator": "ME", "comments": ("none",)}
    for bad in (None, object(), 3.0):
        with pytest.raises(ValueError, match=rf"^{argument}: expected "):
            cf.write_oem(**{**good, argument: bad})
        with pytest.raises(ValueError, match=r"^file: expected "):
            cf.read_oem(bad)
        with pytest.raises(ValueError, match=r"^file: expected "):
            cf.read_oem_segments(bad)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("argument", ["file", "conjunction"])
def test_invalid_arguments_of_conjunction_files_are_named(argument, tmp_path):
    good = {"file": tmp_path / "a.cdm", "conjunction": MEETING}
    for bad in (None, object(), 3.0):
        with pytest.raises(ValueError, match=rf"^{argument}: expected "):
            cf.write_cdm(**{**good, argument: bad})
        with pytest.raises(ValueError, match=r"^file: expected "):
            cf.read_cdm(bad)
    assert not list(tmp_path.iterdir())


# --- memory layouts ---------------------------------------------------------------------------


def strided(array):
    """Return a big-endian view of every second number of a larger array."""
    room = np.full((*array.shape[:-1], 2 * array.shape[-1]), np.nan, ">f8") if array.ndim else np.empty(())
    return np.copyto(room[..., ::2], array) or room[..., ::2]


def frozen(array):
    array = array.copy()
    array.setflags(write=False)
    return array


def mapped(array):
    """Return a read-only map of a file, where a write would end the process."""
    with tempfile.NamedTemporaryFile(suffix=".npy") as file:
        np.save(file.name, array)
        return np.load(file.name, mmap_mode="r")


HELD = {
    "a memory map": mapped,
    "strided": strided,
    "lists": lambda array: array.tolist(),
}


def held(value, how):
    """Return an argument with its arrays in another layout."""
    if isinstance(value, np.ndarray) and value.dtype == float:
        return HELD[how](value)
    if isinstance(value, cf.Path):
        arrays = HELD[how] if how in ("a memory map", "strided") else frozen
        arcs, offsets = arrays(value.arcs), frozen(value.offsets)
        path = copy(value)  # without __init__, as pickle does
        object.__setattr__(path, "arcs", arcs if arcs.flags.c_contiguous else frozen(value.arcs))
        object.__setattr__(path, "offsets", offsets)
        return path
    if isinstance(value, cf.Zone) and how == "a memory map":
        zone = copy(value)
        object.__setattr__(zone, "matrix", HELD[how](value.matrix))
        return zone
    if isinstance(value, cf.Uncertainty) and how == "a memory map":
        errors = copy(value)
        errors.__dict__.update(state=HELD[how](value.state), _root=HELD[how](value._root))
        return errors
    if isinstance(value, list):
        return [held(one, how) for one in value]
    return value


def flat(answer):
    """Return the numbers of a result."""
    if is_dataclass(answer) and not isinstance(answer, type):
        return [number for field in fields(answer) for number in flat(getattr(answer, field.name))]
    if isinstance(answer, list | tuple):
        return [number for one in answer for number in flat(one)]
    if isinstance(answer, np.ndarray | float | int | np.generic) and not isinstance(answer, Enum):
        return np.ravel(answer).astype(float).tolist()
    return []


ONCE = ("a memory map",)
COSTLY = dict.fromkeys(
    (
        *("avoid, drift", "avoid, errors", "max_clearance, errors", "max_clearance", "longest_lock"),
        *("collision_probability", "plots.pulses", "plots.trade", "gather"),
    ),
    ONCE,
)


@pytest.mark.parametrize("name", CALLS)
def test_results_do_not_depend_on_memory_layout(name):
    """Results are identical, and no array of the caller is written."""
    plain = flat(call(name))
    for how in COSTLY.get(name, HELD):
        given = {argument: held(value, how) for argument, value in CALLS[name].items()}
        np.testing.assert_array_equal(flat(call(name, **given)), plain, err_msg=how)


def test_float32_is_converted_exactly():
    states = START.astype(np.float32)
    np.testing.assert_array_equal(ORBIT.coast(states, 900.0).state(9.0), COAST.state(9.0))


def test_all_public_functions_are_called():
    """Results, pictures and files have tests of their own."""
    others = {"read_oem", "read_oem_segments", "write_oem", "read_cdm", "write_cdm", "run", "study"}
    others |= {"load", "export", "read_csv"}
    others |= {"Status", "Search", "Screening", "CommonFrame"}
    others |= {name for name in CALLABLES if name.startswith(("plots.", "requirements.", "flight."))}
    others |= {"plot", "animate"}
    others |= {name for name in CALLABLES if name.endswith(".columns")}
    others |= {name for name in CALLABLES if name.startswith(("PairZones", "Zone"))}
    assert CALLABLES.keys() - CALLS.keys() - RESULTS - others == set()


def test_all_arguments_are_given():
    given = {}
    for name, arguments in CALLS.items():
        given.setdefault(name.partition(",")[0], {"cls", "self", "execution", "tracking"}).update(arguments)
    for name in given.keys() - {name for name in given if name.startswith("plots.")}:
        assert inspect.signature(CALLABLES[name]).parameters.keys() - given[name] == set(), name


TRIO = LOW.orbit.transfer(np.eye(6)[[1, 1, 1]] * [[60.0], [120.0], [180.0]], np.zeros(6), 900.0)
PAIR = [0.01, 0.01]  # where one, or three, are meant
ENDS = TRIO.state(0.0), TRIO.state(0.0) + [0.0, 0.0, 90.0, 0.0, 0.0, 0.0]


def wide(margin):
    return cf.reconfigure(LOW.orbit, *ENDS, 900.0, BALL, margin=margin, assign=False)


@pytest.mark.parametrize(
    ("key", "call"),
    [
        ("max_acceleration", lambda: cf.reconfigure(LOW.orbit, *ENDS, 900.0, BALL, max_acceleration=PAIR)),
        ("duration", lambda: cf.reconfigure(LOW.orbit, *ENDS, [900.0, 800.0], BALL)),
        ("max_acceleration", lambda: cf.simulate(TRIO, cf.Field(LOW), max_acceleration=PAIR)),
        ("residual", lambda: cf.tracking_margins(TRIO, cf.Field(LOW), residual=PAIR)),
        ("max_acceleration", lambda: cf.fit_margin(wide, cf.Field(LOW), BALL, max_acceleration=PAIR)),
        ("mass", lambda: cf.fire_thrusters(TRIO, SIX, mass=PAIR, specific_impulse=60.0)),
        (
            "ballistic",
            lambda: cf.compensated_thrust(TRIO, cf.Field(LOW, drag=cf.Drag(5e-13, 5e5, 6e4, PAIR, 0.02))),
        ),
    ],
)
def test_wrong_number_of_values_is_refused(key, call):
    with pytest.raises(
        ValueError, match=rf"^{key}: expected one number, or one for each of 3 craft, got shape \(2,\)$"
    ):
        call()


MASKED = np.ma.masked_array([0.0, 200, 0, 0, 0, 0], mask=[0, 1, 0, 0, 0, 0])
UNIT = [1.0, 0.0, 0.0]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("key", "call"),
    [
        ("state", lambda: ORBIT.coast(MASKED, 900.0)),
        ("state", lambda: ORBIT.coast([MASKED, MASKED], 900.0)),
        ("radius", lambda: cf.Sphere(np.ma.masked)),
        ("radius", lambda: cf.Sphere(True)),
        ("half_widths", lambda: cf.Box([True, 2.0, 3.0])),
        ("state", lambda: ORBIT.coast(np.ones(6, dtype=bool), 900.0)),
        ("mean_motion", lambda: cf.Orbit(10**400)),
        ("state", lambda: ORBIT.coast([10**400, 0, 0, 0, 0, 0], 900.0)),
        ("relative_position", lambda: cf.lock_times(SEARCH, [[1e160, 0, 0]], [UNIT])),
        ("relative_position", lambda: cf.lock_times(SEARCH, [[9e59, 9e59, 0]], [UNIT])),
        ("relative_velocity", lambda: cf.lock_times(SEARCH, [UNIT], [[1e160, 0, 0]])),
        ("relative_velocity", lambda: cf.lock_times(SEARCH, [UNIT], [[np.nan, 0, 0]])),
        ("period", lambda: cf.Orbit.from_period(1e-310)),
        ("semi_major_axis", lambda: cf.Orbit.from_semi_major_axis(1e-310)),
        ("axes", lambda: cf.Box([1.0, 2.0, 3.0], axes=1e200 * np.eye(3))),
        ("axes", lambda: cf.Box([1.0, 2.0, 3.0], axes=np.full((3, 3), np.inf))),
        ("position", lambda: BALL.norm([np.nan, 0, 0])),
        ("direction", lambda: BALL.support([0, np.inf, 0])),
    ],
)
def test_masked_boolean_and_overflowing_numbers_are_refused(key, call):
    with pytest.raises(ValueError, match=rf"^{key}: "):
        call()


def test_unmasked_masked_arrays_are_accepted():
    plain = np.ma.masked_array(START, mask=np.zeros_like(START))
    np.testing.assert_array_equal(ORBIT.coast(plain, 900.0).arcs, COAST.arcs)
