"""Epochs against astropy: time systems and leap seconds, to a nanosecond."""

from datetime import datetime

import numpy as np
import pytest
from astropy.time import Time, TimeDelta
from hypothesis import example, given, settings
from hypothesis import strategies as st

from closeform.exchange.epochs import SYSTEMS, Epoch, EpochError, seconds_of

NANOSECOND = 1e-9
# ERFA's series and astropy's are the same; a date in two parts holds a hundredth of a nanosecond.
SAME = 1e-10


def by_astropy(stamp: str, system: str) -> Time:
    """Return the same instant by astropy; GPS time is TAI less 19 s."""
    if system == "GPS":
        return Time(stamp, scale="tai") + TimeDelta(19.0, format="sec")
    return Time(stamp, scale=system.lower())


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("stamp", ["2016-12-31T12:00:00", "2025-07-01T03:04:05.123456789"])
def test_conversion_to_utc_agrees_with_astropy(system, stamp):
    epoch = Epoch(stamp, system)
    times = np.array([0.0, 0.123456789, 86400.0, 3.0e6, -1.5e5])
    utc = epoch.utc(times)
    for time, found in zip(times, utc, strict=True):
        truth = (by_astropy(stamp, system) + TimeDelta(time, format="sec")).utc
        assert found.endswith("Z")
        assert len(found.partition(".")[2]) == 10
        assert abs((Time(found[:-1], scale="utc") - truth).to_value("s")) < 0.51 * NANOSECOND + SAME


@pytest.mark.parametrize(("one", "other"), list(zip(SYSTEMS, [*SYSTEMS[1:], SYSTEMS[1]], strict=True)))
def test_seconds_between_systems(one, other):
    here, there = "2016-06-30T11:22:33.25", "2017-06-30T11:22:33.75"
    apart = Epoch(here, one).until(Epoch(there, other))
    truth = (by_astropy(there, other).tai - by_astropy(here, one).tai).to_value("s")
    if one == other:  # counted in the system itself, whose second may be another
        scale = "tai" if one == "GPS" else one.lower()
        truth = (Time(there, scale=scale) - Time(here, scale=scale)).to_value("s")
    assert apart == pytest.approx(truth, rel=0.0, abs=1e-8)  # a double of 3e7 s holds 4e-9
    assert Epoch(there, other).until(Epoch(here, one)) == pytest.approx(-apart, rel=0.0, abs=1e-8)


def test_the_leap_second_of_2016():
    epoch = Epoch("2016-12-31T23:59:59Z")
    assert epoch.utc([0.0, 1.0, 1.5, 2.0]) == [
        "2016-12-31T23:59:59.000000000Z",
        "2016-12-31T23:59:60.000000000Z",
        "2016-12-31T23:59:60.500000000Z",
        "2017-01-01T00:00:00.000000000Z",
    ]
    assert epoch.until(Epoch("2017-01-01T00:00:00")) == 2.0
    assert Epoch("2016-12-31T23:59:60.25").until(Epoch("2017-01-01T00:00:00")) == 0.75
    # 36 s and then 37 s behind TAI, GPS another 19 s
    assert Epoch("2017-01-01T00:00:36", "TAI").utc([0.0])[0].startswith("2016-12-31T23:59:60")
    assert Epoch("2017-01-01T00:00:37", "TAI").until(Epoch("2017-01-01T00:00:00")) == 0.0
    assert Epoch("2017-01-01T00:00:18", "GPS").until(Epoch("2017-01-01T00:00:00")) == 0.0


@given(
    st.datetimes(datetime(1972, 1, 1), datetime(2060, 12, 31)), st.integers(0, 999), st.sampled_from(SYSTEMS)
)
@settings(max_examples=50, deadline=None)
def test_nine_decimals_round_trip(moment, nanoseconds, system):
    stamp = f"{moment:%Y-%m-%dT%H:%M:%S}.{moment.microsecond:06}{nanoseconds:03}"
    epoch = Epoch(stamp, system)
    assert epoch.stamps([0.0]) == [stamp]
    if system == "UTC":
        assert epoch.utc([0.0]) == [stamp + "Z"]


@given(st.floats(0.0, 1e6), st.sampled_from(SYSTEMS))
@example(997777.2600231465, "GPS")  # between two nanoseconds
@settings(max_examples=50, deadline=None)
def test_times_and_epochs_round_trip(time, system):
    epoch = Epoch("2016-12-28T17:00:00.000000001", system)
    (stamp,) = epoch.stamps([time])
    assert seconds_of([epoch.stamp, stamp], system)[1] == pytest.approx(
        time, rel=0.0, abs=0.51 * NANOSECOND + SAME
    )


def test_formats_of_epochs():
    assert Epoch.of("2026-11-22T12:00:00Z") == Epoch("2026-11-22T12:00:00Z", "UTC")
    assert Epoch.of(" 2026-11-22T12:00:37  TAI ").until(Epoch("2026-11-22T12:00:00")) == 0.0
    assert Epoch("2026-326T12:00:00").until(Epoch("2026-11-22T12:00:00")) == 0.0
    assert str(Epoch("2026-11-22T12:00:00Z")) == "2026-11-22T12:00:00 UTC"


def test_invalid_epochs():
    for stamp in [
        *("", "now", "2026-11-22", "2026-11-22 12:00:00", "2026-11-22T12:00", "2026-11-22T12:00:00+01:00"),
        *("2026-02-29T00:00:00", "2025-366T00:00:00", "2026-000T00:00:00", "0000-01-01T00:00:00"),
        *("2026-11-22T24:00:00", "2026-11-22T12:60:00", "2026-11-22T12:00:60", "2026-11-22T12:00:-1"),
        *("2017-06-30T23:59:60", "2016-12-31T23:58:60", "2016-12-31T23:59:61"),  # no such leap second
    ]:
        with pytest.raises(EpochError, match=r"not a valid epoch; write it in the form 2010-07-27T00"):
            Epoch(stamp)


def test_only_utc_has_a_sixtieth_second():
    with pytest.raises(EpochError):
        Epoch("2016-12-31T23:59:60", "TAI")


@pytest.mark.parametrize(
    ("system", "message"),
    [
        ("UT1", "TIME_SYSTEM UT1 requires tables of the Earth's rotation; use one of GPS, TAI"),
        ("MET", "TIME_SYSTEM MET is not supported; use one of GPS, TAI"),
    ],
)
def test_unknown_time_systems_are_refused(system, message):
    with pytest.raises(ValueError, match=message):
        Epoch("2026-11-22T12:00:00", system)
