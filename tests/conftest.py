"""What holds for all tests."""

import os

# As in the workflow's jobs: products of small matrices on several threads wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
