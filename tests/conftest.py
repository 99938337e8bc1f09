"""Before NumPy is loaded: small matrices on many BLAS threads take longer, not shorter."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
