"""Plans in Basilisk, an independent simulator: `-m basilisk`, with the extra of that name."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import closeform as cf

pytest.importorskip("Basilisk", reason="no Basilisk: pip install '.[basilisk]'")

pytestmark = pytest.mark.basilisk
EXAMPLE = Path(__file__).parents[1] / "examples" / "basilisk"


def program(name: str) -> ModuleType:
    sys.path.insert(0, str(EXAMPLE))
    try:
        return import_module(name)
    finally:
        sys.path.remove(str(EXAMPLE))


@pytest.fixture(scope="module")
def example() -> ModuleType:
    return program("fly")


def test_same_field_and_thrust(example: ModuleType, tmp_path: Path) -> None:
    """J2 and drag agree to 1 mm with equally held thrust, and ever closer with shorter steps."""
    alike, apart = example.same_field(tmp_path)
    assert alike < 1e-3  # m, asked; reached: 1e-6
    steps, off = np.array(apart).T
    assert off[-1] < 1e-3
    # the remaining error of held thrust is of second order in its time
    assert np.diff(np.log(off)) / np.diff(np.log(steps)) == pytest.approx(2.0, abs=0.1)


def test_planned_and_compensated_thrust_differ(example: ModuleType, tmp_path: Path) -> None:
    """Planned thrust ends metres off, so that the comparison can fail."""
    one = example.task(1)
    start, commanded = example.exported(one, one.field, tmp_path, 10.0)
    middle = 10.0 * (np.arange(commanded.shape[1]) + 0.5)
    planned = one.plan.paths.thrust(middle)
    flown = example.fly(
        start, lambda t, _: planned[:, round(t / 10.0)], example.end_of(one), example.world(one.field), 10.0
    )
    assert example.off_plan(one, flown.times, example.relative(one, flown)).max() > 1.0


def test_field_of_higher_degree(example: ModuleType, tmp_path: Path) -> None:
    """EGM96 to degree and order 4 on a rotating Earth, which closeform does not know."""
    ends = dict(example.higher_field(tmp_path))
    assert 1e-3 < ends["J2 to J4"] < ends["J2"] < 0.1  # m


def test_feedback_stays_in_the_tube(example: ModuleType, tmp_path: Path) -> None:
    """Eleven of twelve simulations are within the tube of one direction, and no zone is violated."""
    flights = example.twelve_flights(tmp_path)
    whole, radius, off, _, left = np.array(flights).T
    assert len(flights) == 12
    assert left.min() > 0.0
    assert (off <= whole).all()
    assert (off <= radius).sum() >= 11
    assert (off > 0.5 * radius).all()  # the tube is no wide one


def test_lost_pair_with_reaction_wheels() -> None:
    """Wheels of limited torque find the lock of kinematic turns with the same ramps; the burn is exact."""
    pair = program("lost_pair")
    search = cf.Search.modified(cf.Sensor(np.radians(70.0)), np.radians(0.25), np.radians(25.0))
    ramps = cf.SearchErrors(slew_acceleration=pair.RAMP)
    lock = cf.lock_times(search, *pair.PAIR, ramps).time[0]
    flown = pair.fly(search, *pair.PAIR, lock + 500.0)
    # seen at the first sample after it, give or take an attitude error of 0.03 deg at 0.25 deg/s
    assert -0.12 < flown.lock - lock < pair.STEP + 0.12
    assert lock - cf.lock_times(search, *pair.PAIR).time[0] > 400.0  # what the ramps cost
    settled = (flown.times > 120.0) & (flown.times < flown.lock)
    assert np.degrees(flown.off[settled].max()) < 0.03
    assert np.degrees(flown.off.max()) < 0.3
    assert np.abs(flown.torques).max() < pair.TORQUE  # never saturated
    assert flown.attitudes[:, :, 2, 0].max() < -np.cos(np.radians(25.0))  # the shade towards the sun, -z
    relative = np.linalg.norm(flown.states[:, 1, 3:] - flown.states[:, 0, 3:], axis=1)
    assert relative[-1] < 1e-6 < relative[flown.times < flown.lock].min()
