"""What the paper prints and a report sets beside its own numbers."""

from __future__ import annotations

from study.robustness.paper import TABLE_III

__all__ = ["TABLE_III", "TABLE_III_SPREAD"]

TABLE_III_SPREAD = max(TABLE_III.values()) - min(TABLE_III.values())
