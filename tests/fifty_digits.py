"""Kepler motion in fifty digits."""

import mpmath

import closeform as cf


def to_fifty_digits(state, time):
    """Return the position by Lagrange's coefficients in 50 digits."""
    with mpmath.workdps(50):
        mu, time = mpmath.mpf(cf.elements.EARTH_MU), mpmath.mpf(float(time))
        place, speed = (
            mpmath.matrix([mpmath.mpf(float(one)) for one in part]) for part in (state[:3], state[3:])
        )
        radius, climb = mpmath.norm(place), (place.T * speed)[0] / mpmath.sqrt(mu)
        a = 1 / (2 / radius - (speed.T * speed)[0] / mu)
        rate = mpmath.sqrt(mu / a**3)

        def kepler(turn):
            shape = (1 - radius / a) * mpmath.sin(turn) - climb / mpmath.sqrt(a) * (1 - mpmath.cos(turn))
            return turn - shape - rate * time

        turn = mpmath.findroot(kepler, (rate * time - 1, rate * time + 1), solver="anderson")
        f = 1 - a / radius * (1 - mpmath.cos(turn))
        g = time - (turn - mpmath.sin(turn)) / rate
        return [float(one) for one in f * place + g * speed]
