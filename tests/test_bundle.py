"""A bundle holds a run with all that made it, and gives its reports again to the same bytes."""

from __future__ import annotations

import hashlib
import io
import zipfile
from dataclasses import replace

import pytest

from reports import bundle, report
from reports.bundle import bundle as pack
from reports.credibility import credibility
from study.commands.bundle import bundle as bundle_command
from study.commands.report import report as report_command
from study.results import ResultsError
from study.results import folder as results_folder
from study.results.provenance import tissue_sha256
from study.scene.file import read_scene, write_scene
from study.scene.schema import Inclusion, OrganTissue, StiffnessMap
from tests.report_samples import results_of, whole, with_mesh_error, with_model, with_record


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(report, "render", lambda *_: NO_PICTURES)
    made = tmp_path / "run"
    made.mkdir()
    results_folder.write(whole(), made)
    return made


NO_PICTURES = report.Pictures(pixels=None, renderer="none")


def contents(archive):
    with zipfile.ZipFile(archive) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def changed(archive, **files):
    """The archive with other files, and checksums made anew where asked."""
    found = contents(archive) | {name.replace("__", "/"): data for name, data in files.items()}
    archive.write_bytes(bundle.packed(found))


def test_a_bundle_has_results_inputs_versions_citation_and_credibility(folder, tmp_path, capsys):
    bundle_command(folder)
    archive = tmp_path / "run.zip"
    assert capsys.readouterr().out == f"{archive}\n"
    names = set(contents(archive))
    assert names >= {"README.txt", "CITATION.cff", "credibility.md", "SHA256SUMS"}
    assert names >= {"results/results.json", "inputs/scene.toml", "environment/installed.txt"}
    installed = contents(archive)["environment/installed.txt"].decode().splitlines()
    assert any(line.startswith("numpy==") for line in installed)


def test_the_same_folder_gives_the_same_bytes_and_another_other_bytes(folder, tmp_path):
    one, two, other = (tmp_path / f"{name}.zip" for name in ("one", "two", "other"))
    pack(folder, one)
    pack(folder, two)
    assert one.read_bytes() == two.read_bytes()
    (folder / "report.pdf").write_bytes(b"%PDF")
    pack(folder, other)
    assert other.read_bytes() != one.read_bytes()


def test_both_reports_of_a_bundle_come_again_to_the_byte(folder, tmp_path, capsys):
    report_command(folder)
    pack(folder, tmp_path / "run.zip")
    capsys.readouterr()
    report_command(tmp_path / "run.zip", out=tmp_path / "elsewhere")
    told = capsys.readouterr().out.splitlines()
    assert len(told) == sum((folder / name).exists() for name in bundle.REPORTS)
    assert all("the same bytes as in" in line for line in told)
    assert (tmp_path / "elsewhere/report.pdf").read_bytes() == (folder / "report.pdf").read_bytes()


def test_reports_of_other_bytes_are_listed_with_exit_code_1(folder, tmp_path, capsys):
    """Negative control of the test above."""
    report_command(folder)
    (folder / "report.pdf").write_bytes((folder / "report.pdf").read_bytes() + b"\n")
    pack(folder, tmp_path / "run.zip")
    capsys.readouterr()
    with pytest.raises(SystemExit) as left:
        report_command(tmp_path / "run.zip", out=tmp_path / "elsewhere")
    assert left.value.code == 1
    assert "report.pdf: other bytes than in" in capsys.readouterr().out


def test_a_file_that_was_altered_is_named(folder, tmp_path):
    archive = tmp_path / "run.zip"
    pack(folder, archive)
    changed(archive, credibility="")
    with pytest.raises(ResultsError, match="credibility is not as it was packed"):
        bundle.unpack(archive, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_checksums_made_anew_do_not_pass_for_other_results(folder, tmp_path):
    archive = tmp_path / "run.zip"
    pack(folder, archive)
    found = contents(archive)
    found["results/curves.csv"] = found["results/curves.csv"].replace(b"fem", b"fen")
    found.pop("SHA256SUMS")
    sums = "".join(f"{hashlib.sha256(d).hexdigest()}  {n}\n" for n, d in sorted(found.items()))
    archive.write_bytes(bundle.packed(found | {"SHA256SUMS": sums.encode()}))
    with pytest.raises(ResultsError):
        bundle.unpack(archive, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["../evil", "results/../evil", "results/a/b", "/etc/evil"])
def test_a_name_that_leads_elsewhere_is_refused(name, tmp_path):
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr(name, "x")
    (tmp_path / "run.zip").write_bytes(made.getvalue())
    with pytest.raises(ResultsError):
        bundle.unpack(tmp_path / "run.zip", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_cut_archive_is_refused_as_damaged(folder, tmp_path):
    archive = tmp_path / "run.zip"
    pack(folder, archive)
    data = bytearray(archive.read_bytes())
    data[200:220] = bytes(20)
    archive.write_bytes(data)
    with pytest.raises(ResultsError):
        bundle.unpack(archive, tmp_path / "out")
    archive.write_bytes(data[: len(data) // 2])  # no archive by its content any more
    with pytest.raises(ResultsError, match=r"run\.zip: damaged archive"):
        report_command(archive, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_not_replaced(folder, tmp_path):
    pack(folder, tmp_path / "run.zip")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("x")
    with pytest.raises(ValueError, match=r"thesis\.txt"):
        bundle.unpack(tmp_path / "run.zip", tmp_path / "mine")


def test_the_mesh_goes_with_the_run_and_must_be_that_of_it(tmp_path):
    mesh = tmp_path / "my liver.stl"
    mesh.write_text("solid\nendsolid\n")
    base = whole()
    scene = replace(base.scene, organ=replace(base.scene.organ, mesh=str(mesh)))
    digest = hashlib.sha256(mesh.read_bytes()).hexdigest()
    made_by = replace(base.record.provenance, mesh_sha256=digest)
    found = with_record(replace(base, scene=scene), provenance=made_by)
    inputs = bundle._inputs(found.scene)
    assert inputs["inputs/mesh.stl"] == mesh.read_bytes()
    assert b'mesh = "mesh.stl"' in inputs["inputs/scene.toml"]
    bundle._check_inputs(found)
    mesh.write_text("solid other\nendsolid\n")
    with pytest.raises(ValueError, match=r"organ\.mesh: the file has changed since the run"):
        bundle._check_inputs(found)


def test_files_of_the_tissue_go_with_the_run_and_must_be_those_of_it(tmp_path):
    shape, image = tmp_path / "a tumour.STL", tmp_path / "p.1.nii.gz"
    shape.write_text("solid\nendsolid\n")
    image.write_bytes(b"voxels")
    base = whole()
    tissue = OrganTissue(
        inclusion=(Inclusion(youngs_modulus=2e4, mesh=str(shape), unit="mm"),),
        stiffness_map=StiffnessMap(file=str(image), quantity="shear-modulus", unit="kPa"),
    )
    scene = replace(base.scene, tissue=tissue)
    made_by = replace(base.record.provenance, tissue_sha256=tissue_sha256(scene))
    found = with_record(replace(base, scene=scene), provenance=made_by)
    inputs = bundle._inputs(found.scene)
    assert inputs["inputs/inclusion-1.STL"] == shape.read_bytes()
    assert inputs["inputs/stiffness-map.nii.gz"] == b"voxels"
    assert str(tmp_path).encode() not in inputs["inputs/scene.toml"]
    for name, data in inputs.items():
        (tmp_path / name.removeprefix("inputs/")).write_bytes(data)
    again = read_scene(str(tmp_path / "scene.toml")).tissue
    assert again.inclusion[0].mesh == str(tmp_path / "inclusion-1.STL")
    assert again.stiffness_map.file == str(tmp_path / "stiffness-map.nii.gz")
    bundle._check_inputs(found)
    image.write_bytes(b"other voxels")
    with pytest.raises(ValueError, match=r"stiffness_map\.file: the file has changed since"):
        bundle._check_inputs(found)


def test_the_scene_of_a_bundle_is_that_of_the_run(folder, tmp_path):
    pack(folder, tmp_path / "run.zip")
    path = tmp_path / "scene.toml"
    path.write_bytes(contents(tmp_path / "run.zip")["inputs/scene.toml"])
    assert write_scene(read_scene(str(path))) == write_scene(whole().scene)


# --- credibility ---------------------------------------------------------------------------------


def test_the_summary_has_the_terms_of_the_standard_and_leaves_the_risk_to_the_reader():
    text = credibility(results_of())
    for term in ("Question of interest", "Context of use", "Model risk", "Validation"):
        assert f"## {term}\n" in text
    assert "Left to the reader" in text
    assert "the comparator is another model" in text


def test_its_figures_are_those_of_the_run():
    text = credibility(with_mesh_error(field_peak=0.0421))
    assert "discretisation error of the field at the peak, 4.2 %" in text
    assert "1 of 2 passed" in text
    assert "Failed: step, 0.0200 of at most 0.01" in text
    assert "interval 12.50 to 16.00 kPa" in text


def test_a_diverged_model_and_a_run_without_finite_elements_are_said_to_be_so():
    lost = with_model(results_of(), "basafa", status="diverged", ended_at_s=0.5)
    assert "Basafa benchmark: diverged at 0.500 s; no error is estimated" in credibility(lost)
    assert "differences between its models are not errors" in credibility(
        results_of(["basafa", "msm-sugeno"])
    )
