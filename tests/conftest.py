"""Before NumPy is loaded: small matrices on many BLAS threads take longer, not shorter."""

import os

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Kernels are compiled before a test looks at what a command says on standard error."""
    from closeform.warmup import compile_ahead

    compile_ahead("closeform.planning.contacts")
    compile_ahead("closeform.search.chain")
