"""Entry of `liver-study` and `python -m study`."""

import gc
import os
import sys

from study.system import signals, streams

# Linear algebra here is sparse or small. OpenBLAS would start threads that mostly wait, at a cost
# of a fifth of the processor time of a quick command. It reads this when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
YOUNG = 50_000
"""Objects between two looks for cyclic garbage; with Python's 700 they take an eighth of a plot."""


def main() -> None:
    """Run the command line. From its first instant, a signal ends it by a message."""
    signals.listen(signals.leave_at_once)
    gc.set_threshold(YOUNG)
    streams.prepare()
    from study.commands.application import main as commands

    sys.exit(commands())


if __name__ == "__main__":
    main()
