"""Results that the program left in a folder, where they are as good as a run made now."""

from pathlib import Path

from study.results import Results, ResultsError
from study.results.folder import MARK, read
from study.results.provenance import provenance
from study.scene import Scene
from study.scene.file import write_scene

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("study", "fem_reference", "msm", "fuzzy")
# A run loads the program before its clock starts.
LOADING = 10.0


def origin(results: Results):
    """What made the results, and the seconds it took."""
    return results.record.provenance, results.record.study_wall_s


def as_good_as_now(folder: Path, scene: Scene) -> Results | None:
    """Results of `scene` in a folder; None unless this very program made them, here.

    Commit, versions, platform, processor and scene must be those of now, and the checkout clean.
    The commit is noted at the end of a run, so no source may be younger than its beginning either.
    """
    return trusted(folder, provenance(write_scene(scene), scene.organ.mesh), youngest_source())


def trusted(folder, now, youngest):
    try:
        results = read(folder)
    except ResultsError:
        return None
    made_by, wall = origin(results)
    began = (folder / MARK).stat().st_mtime - wall - LOADING
    return results if made_by == now and is_clean(now) and youngest < began else None


def is_clean(made_by):
    commit = made_by.commit
    return commit is not None and not commit.endswith("-dirty")


def youngest_source():
    """When a file of the program was last written, in seconds of the file system's clock."""
    files = (path for package in PACKAGES for path in (ROOT / package).rglob("*"))
    return max(f.stat().st_mtime for f in files if f.is_file() and "__pycache__" not in f.parts)
