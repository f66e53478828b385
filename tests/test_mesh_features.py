"""Every feature of a mesh file is treated as docs/mesh_formats.md says."""

from __future__ import annotations

import pytest

from study.mesh.kinds import MeshError, TetrahedralMesh
from study.mesh.load import load_mesh
from tests.mesh_features import PAGE, Feature, features, page
from tests.mesh_samples import CUBE_VOLUME

FEATURES = features()
SINGLE = 1e-6  # files with 32-bit floats


def treated(feature: Feature, folder) -> None:
    """Assert what the feature promises."""
    path = feature.write(folder)
    if feature.treatment == "refused":
        assert feature.words
        with pytest.raises(MeshError) as caught:
            load_mesh(path, "m")
        message = str(caught.value)
        assert message.startswith(str(path))
        assert feature.words in message
        assert "\n" not in message
        return
    mesh, report = load_mesh(path, "m")
    assert report.volume == pytest.approx(CUBE_VOLUME, rel=SINGLE)
    assert not isinstance(mesh, TetrahedralMesh) or len(mesh.tetrahedra) == 48
    if feature.treatment == "ignored":
        # Every facet of an STL file has nodes of its own, which is nothing special.
        assert [note for note in report.notes if " welded to " not in note] == []
    if feature.treatment == "ignored with a note":
        assert feature.words
        assert any(feature.words in note for note in report.notes)


@pytest.mark.parametrize(
    "feature", FEATURES, ids=[f"{feature.format}: {feature.name}" for feature in FEATURES]
)
def test_a_feature_is_treated_as_the_page_says(feature, tmp_path):
    treated(feature, tmp_path)


def test_the_page_is_the_list():
    assert PAGE.read_text() == page(FEATURES), "stale: python -m tests.mesh_features"


def test_features_of_a_format_stand_together():
    formats = [feature.format for feature in FEATURES]
    runs = [name for i, name in enumerate(formats) if i == 0 or formats[i - 1] != name]
    assert len(runs) == len(set(runs))


@pytest.mark.parametrize("wrong", ["read", "ignored", "ignored with a note"])
def test_a_refused_file_does_not_pass_for_a_read_one(wrong, tmp_path):
    """Negative control."""
    refused = next(feature for feature in FEATURES if feature.treatment == "refused")
    with pytest.raises(MeshError):
        treated(refused._replace(treatment=wrong), tmp_path)
