"""On what a benchmark ran: the processor, and how busy it was."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path


def machine() -> str:
    """Processor, cores and Python."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    name = next(line.partition(": ")[2] for line in lines if line.startswith("model name"))
    name = re.sub(r"\((R|TM)\)| Processor| CPU", "", name)
    return f"{name}, {os.cpu_count()} cores, shared; Python {platform.python_version()}"


def load() -> float:
    """Processes that ran or waited, mean of the last minute; a benchmark alone makes it 1."""
    return os.getloadavg()[0]
