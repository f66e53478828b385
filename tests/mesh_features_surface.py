"""Features of surface formats and of all VTK formats."""

from __future__ import annotations

from tests.mesh_features import Feature

FEATURES: list[Feature] = []
