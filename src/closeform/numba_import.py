"""numba without SciPy, and garbage that is seldom looked for, in processes that are ours alone."""

import gc
import sys

RARELY = 50_000, 20, 20  # objects more; a picture makes about as many, and imports far more that stay


def collect_rarely() -> None:
    """Look for garbage in cycles less often: that is a fifth of the time that pictures take."""
    gc.set_threshold(*RARELY)


def import_numba() -> None:
    """Import numba in half of its time.

    It asks at import whether there is a BLAS for `np.correlate` in kernels, and loads `scipy.linalg`
    for the answer.  No kernel of ours correlates, but others' may, in processes that they share.
    """
    if "scipy.linalg" in sys.modules:
        return
    sys.modules["scipy.linalg"] = None  # type: ignore[assignment]  # as Python marks what is not to load
    try:
        import numba  # noqa: F401
    finally:
        del sys.modules["scipy.linalg"]
