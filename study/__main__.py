"""Entry of `liver-study` and `python -m study`."""

import os

# Linear algebra here is sparse or small. OpenBLAS would start threads that mostly wait, at a cost
# of a fifth of the processor time of a quick command. It reads this when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from study.commands import main

if __name__ == "__main__":
    main()
