"""Before NumPy is loaded: small matrices on many BLAS threads take longer, not shorter."""

import os

import hypothesis
import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# the first call of a kernel may compile it for seconds
hypothesis.settings.register_profile("compiles", deadline=None)
hypothesis.settings.load_profile("compiles")


@pytest.fixture(scope="session", autouse=True)
def announced() -> None:
    """That kernels are compiled is said before a test looks at what a command says on standard error."""
    from closeform.compiled import announce

    announce()
