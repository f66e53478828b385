"""What `run` refuses, `check` refuses in the same words; what `check` passes, `run` runs."""

import random
from functools import partial

import pytest

from study.commands import EXIT_BAD_INPUT
from study.run.check import describe_scene
from study.run.study import run_study
from study.scene.file import read_scene, write_scene

TINY = (
    'organ.size=["30 mm", "30 mm", "30 mm"]',
    "tool.radius=15 mm",
    "tool.force=0.02 N",
    "reference.element_size=30 mm",
    "time.duration=0.15 s",
    "time.samples=16",
    'tool.history={kind="step"}',
    "fuzzy.sensitivity_readings=0",
    'fuzzy.systems=["sugeno"]',
)
TISSUE = 'models=["tissue"]'


def sets(*overrides):
    return [word for one in overrides for word in ("--set", one)]


def complaint(ended):
    """The message, without the stages that a run tells before it."""
    return ended.stderr[ended.stderr.index("liver-study: ") :]


BAD = [
    ("block", "tissue.poisson_ratio=0.5", "tissue.poisson_ratio: must lie between 0 and 0.49999"),
    ("block", "tissue.poisson_ratio=-0.1", "tissue.poisson_ratio: must lie"),
    ("block", "tissue.poisson_ratio=0.2|lattice.volume_term=true", "lattice.volume_term: needs"),
    ("block", "lattice.integrator=split-volume", "lattice.integrator: split-volume needs"),
    ("block", "lattice.integrator=xpbd", "takes linear springs only"),
    ("block", "tool.radius=0.1 mm", "tool: touches no surface"),
    ("block", 'tool.radius=0.4 mm|models=["fem"]', "tool: touches no surface on a mesh of 384"),
    ("block", 'tool.place={point=["65 mm", 0, 0], snap=false}', "tool: touches no surface"),
    ("block", 'tool.place={point=["9 m", 0, 0]}', "tool.place.point: is 8970 mm off the organ"),
    ("block", 'tool=[{}, {place={point=["65 mm", 0, 0], snap=false}}]', "tool.2: touches no"),
    ("block", 'further_tools=[{force="1 N"}]', 'further_tools=[{force="1 N"}]: unknown key; write'),
    ("block", "tool.radius=2", "tool.radius: 2000 mm is more than twice the organ, which is"),
    ("block", "support.depth=1", "support.depth: 1000 mm is more than twice the organ"),
    ("block", "tool.displacement=-1|tool.shape=sphere", "tool.displacement: 1000 mm is more than"),
    ("block", "tool.place.at=[0.5, 0.5, 0.5]", "tool.place.at: should have 2 entries, not 3"),
    ("block", 'weight=[{place={side="left", at=[0.5, 0.5]}}]', "weight.1.mass: missing; give it"),
    ("block", 'models=["FEM"]', "did you mean 'fem'?"),
    ("block", 'control_points={"a\\nb"={fraction=[0.5, 0.5, 0.5]}}', "is no name; give one of"),
    (
        "block",
        'tool.place={point=["30 mm", "20 mm", "35 mm"], snap=false}|control_points={}',
        "tool.place: lies outside the organ",
    ),
    ("block", 'weight=[{mass="1 g", place={point=["65 mm", 0, 0], snap=false}}]', "weight.1: to"),
    ("block", "gravity.towards=left", "gravity.acceleration: give it"),
    ("block", "tool.direction=[0, 0, 1]", "tool.direction: points out"),
    ("block", "tool.direction=[0, 0, 0]", "tool.direction: a zero vector"),
    ("block", "tool.direction=[0, 0, -1e-200]", "tool.direction: a zero vector"),
    ("block", 'tissue.inclusion={radius="1 mm"}', "tissue.inclusion: write each as [[tissue.incl"),
    ("block", "tool.place={side='superior'}", "tool.place: give either side and at"),
    ("block", 'control_points.far={point=["65 mm", 0, 0], snap=false}', "control_points.far: lies"),
    ("block", "lattice.time_step=7 ms", "lattice.time_step: 0.007 s does not divide"),
    ("block", "lattice.time_step=1 ns", "enlarge lattice.time_step"),
    ("block", "lattice.time_step=1 ms|lattice.step_rate=1 kHz", "contradicts"),
    ("block", "lattice.step_rate=1 GHz", "reduce lattice.step_rate"),
    ("block", "lattice.step_fraction=1e-4|time.duration=10 s", "lattice.step_fraction"),
    ("block", "support.stiffness=1e12 Pa/m|time.duration=1000 s", "support.stiffness"),
    ("block", f"{TISSUE}|tissue.youngs_modulus=1 MPa|time.duration=1 h", "time.duration"),
    ("block", "lattice.spacing=1 um", "lattice.spacing: 0.001 mm makes"),
    ("block", "lattice.spacing=1 m", "reduce lattice.spacing"),
    ("block", "lattice.flexion=1", "lattice.flexion: must lie"),
    ("block", "reference.element_size=1 um", "reference.element_size: 0.001 mm makes"),
    ("block", "models=[]", "models: empty"),
    ("block", 'models=["fem", "fem"]', "models: a model is named twice"),
    ("block", 'models=["fme"]', "did you mean 'fem'"),
    ("block", "fuzzy.reading=R9", "fuzzy.reading = 'R9': use one of R1,"),
    ("block", 'fuzzy.reading=R9|models=["fem"]', "fuzzy.reading = 'R9'"),
    ("paper", "fuzzy.reading=R7", "no data describe"),
    ("paper", "patient.hcv=100 kPa|fuzzy.out_of_range=raise", "outside 2-75 kPa"),
    ("paper", 'models=["fem"]', "models: fem needs an organ"),
    ("paper", "lattice.spacing=1 mm", "has no effect on a single point"),
    ("paper", "damping.ratio=0", "organ.mass: cannot follow"),
    ("paper", "tool.force=nan", "tool.force: must be finite"),
    ("paper", "tool.force=inf", "tool.force: must be finite"),
    ("paper", "tool.force=1 n", "did you mean 'N'"),
    ("paper", "time.samples=3", "time.samples: must lie"),
    ("paper", "time.samples=16.5", "time.samples: write a whole number"),
    ("paper", "tool.froce=1 N", "did you mean 'force'"),
    ("paper", "force=1 N", "did you mean 'tool.force'"),
    ("paper", "organ.mesh=nowhere.stl", "nowhere.stl: no such file"),
    ("paper", "organ=1", "organ: should be a table"),
    ("liver", "organ.volume=1.5 ml", "reference.element_size: 17 mm is too large"),
    ("liver", "organ.volume=1 ML", "did you mean 'ml'"),
    ("liver", "reference.element_size=1 mm", "reference.element_size: 1 mm makes"),
]


@pytest.mark.parametrize(("scene", "overrides", "words"), BAD, ids=[b[1] for b in BAD])
def test_check_and_run_refuse_a_scene_in_the_same_words(scene, overrides, words, typed, tmp_path):
    base = TINY if scene == "block" else ()
    given = sets(*base, *overrides.split("|"))
    checked, ran = typed("check", scene, *given), typed("run", scene, "--no-report", *given)
    assert words in complaint(checked)
    assert complaint(ran) == complaint(checked)
    assert (checked.returncode, ran.returncode) == (EXIT_BAD_INPUT, EXIT_BAD_INPUT)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_the_table_is_not_short():
    assert len(BAD) >= 40


LEGAL = [
    ("block", f"{TISSUE}|tissue.poisson_ratio=0.49999"),
    ("block", f"{TISSUE}|tissue.poisson_ratio=0"),
    (
        "block",
        f"{TISSUE}|tissue.poisson_ratio=0.49999|lattice.volume_term=true"
        "|lattice.integrator=split-volume",
    ),
    ("block", f"{TISSUE}|lattice.time_step=2.5 ms"),
    ("block", f"{TISSUE}|lattice.integrator=velocity-verlet|lattice.step_fraction=10"),
    ("block", f"{TISSUE}|lattice.spacing=20 mm"),
    ("block", f"{TISSUE}|lattice.springs=tetrahedra"),
    ("block", f"{TISSUE}|support.stiffness=1 Pa/m|support.depth=1 um"),
    ("block", f"{TISSUE}|tool.force=1 nN"),
    ("block", f"{TISSUE}|reference.element_size=10 m"),
    ("block", f"{TISSUE}|control_points.in={{fraction=[0.5, 0.5, 0.5], snap=false}}"),
    ("block", 'models=["basafa"]|damping.ratio=100'),
    ("block", 'models=["superposition"]|superposition.count=2|support.stiffness=1e12 Pa/m'),
    ("paper", "tool.force=1 kN"),
    ("paper", "time.duration=1 us"),
    ("paper", "organ.mass=100 kg|damping.ratio=0"),
]


@pytest.mark.parametrize(("scene", "overrides"), LEGAL, ids=[b[1] for b in LEGAL])
def test_what_is_odd_but_legal_is_checked_and_run(scene, overrides, tmp_path):
    base = TINY if scene == "block" else ("fuzzy.sensitivity_readings=0", "time.samples=16")
    given = [*base, *overrides.split("|")]
    assert describe_scene(scene, given, tmp_path / "out")
    assert run_study(read_scene(scene, given)).record.models


def test_nearly_incompressible_tissue_runs_without_a_volume_term_whatever_the_models():
    """The limits of the lattice beside it are then told with that of the volume term."""
    nu = "tissue.poisson_ratio=0.49999"
    limits = run_study(read_scene("block", [*TINY, nu, 'models=["fem", "msm"]'])).record
    assert limits.lattice_limits.relative_l2_with_volume_term < limits.lattice_limits.relative_l2


def test_a_tool_that_only_the_coarsest_mesh_misses_does_not_end_a_run():
    """Of the three meshes two are left to tell the error."""
    levels = []
    for radius in ("15 mm", "0.8 mm"):
        given = [*TINY, f"tool.radius={radius}", 'models=["fem"]', "reference.element=p1"]
        found = run_study(read_scene("block", given)).model("fem").elements
        levels.append([level.elements for level in found.levels])
    assert levels == [[48, 162, 384], [162, 384]]


@pytest.mark.parametrize(
    "words",
    [
        ("tradeoff", "block"),
        ("tradeoff", "block", "--dry-run"),
        ("recommend", "block", "--rate", "60 Hz"),
        ("stability", "block.toml"),
        ("stability", "block.toml", "--dry-run"),
        ("export", "block", "--to", "vtu"),
        ("export", "block", "--to", "calculix"),
    ],
)
def test_every_study_of_a_scene_refuses_it_at_the_start_as_run_does(words, typed, tmp_path):
    bad = "tool.radius=0.1 mm"
    (tmp_path / "block.toml").write_text(write_scene(read_scene("block", [*TINY, bad])))
    given = () if "block.toml" in words else sets(*TINY, bad)
    refused = typed(*words, *given)
    ran = typed("run", "block.toml")
    assert refused.returncode == EXIT_BAD_INPUT
    assert complaint(refused) == complaint(ran)
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == {"block.toml"}


@pytest.mark.parametrize(
    "words",
    [
        ("check", "paper"),
        ("run", "paper"),
        ("tradeoff", "block"),
        ("tradeoff", "block", "--dry-run"),
        ("stability", "block"),
        ("stability", "block", "--dry-run"),
        ("export", "block", "--to", "vtu"),
        ("recommend", "block", "--rate", "60 Hz"),
    ],
)
@pytest.mark.parametrize("place", ["file", "file/below", "n" * 300])
def test_an_output_that_cannot_be_written_is_refused_at_the_start(words, place, typed, tmp_path):
    (tmp_path / "file").write_text("mine")
    if words[0] == "recommend" and place == "file":
        place = "."
    done = typed(*words, "--out", place)
    assert done.returncode == EXIT_BAD_INPUT
    assert place in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "mine"


def test_check_looks_at_the_folder_of_the_run(typed, tmp_path):
    foreign = tmp_path / "results" / "paper" / "thesis.tex"
    foreign.parent.mkdir(parents=True)
    foreign.write_text("")
    checked, ran = typed("check", "paper"), typed("run", "paper")
    assert "holds thesis.tex" in checked.stderr
    assert complaint(ran) == complaint(checked)
    assert typed("check", "paper", "--out", "elsewhere").returncode == 0
    assert not (tmp_path / "elsewhere").exists()


IDLE = [
    (("check", "cube.stl", "--set", "tool.force=1 N"), "--set: cube.stl is a mesh"),
    (("check", "cube.stl", "--out", "here"), "--out: cube.stl is a mesh"),
    (("check", "paper", "--unit", "mm"), "--unit: paper is a scene"),
    (("run", "paper", "--fields"), "--fields: a single point has none"),
    (("estimate", "--hcv", "9", "--system", "sugeno", "--reducer", "eiasc"), "--reducer: only"),
    (("estimate", "--hcv", "9", "--system", "mamdani", "--footprint", "scaled"), "--footprint:"),
    (
        ("estimate", "--hcv", "9", "--system", "mamdani", "--footprint-factor", "2"),
        "--footprint-factor: only interval-type-2",
    ),
    (
        ("estimate", "--hcv", "9", "--system", "mamdani", "--sugeno-aggregation", "max"),
        "--sugeno-aggregation: only sugeno",
    ),
    (("estimate", "--hcv", "9", "--sampling", "exact", "--samples", "99"), "--samples: has no"),
    (
        (
            *("estimate", "--hcv", "9", "--hbv", "9", "--ald", "9", "--cld", "9", "--nafld", "9"),
            *("--absent", "silent"),
        ),
        "--absent: no reading is absent",
    ),
    (("estimate", "--hcv", "9", "--surface", "hcv", "ald"), "--surface: only with --figures"),
    (("estimate", "--hcv", "9", "--explain", "--json"), "--explain: is a text"),
    (("estimate", "--hcv", "9", "--row", "2"), "--row: only with a table"),
    (("rules", "--absent", "silent"), "--absent: is of a patient"),
    (("rules", "--footprint", "scaled"), "--footprint: only a .json file"),
    (("rules", "--footprint-factor", "2", "--out", "a.fis"), "--footprint-factor: only a .json"),
    (("rules", "--sugeno"), "--sugeno: only with --out"),
    (("tradeoff", "block", "--workers", "-1", "--dry-run"), "workers: -1 is negative"),
    (("stability", "--workers", "2", "--scheduler", "tcp://a:1", "--dry-run"), "give one"),
]


@pytest.mark.parametrize(("words", "message"), IDLE, ids=[" ".join(i[0]) for i in IDLE])
def test_a_flag_that_does_not_apply_is_an_error(words, message, typed, tmp_path):
    if words[1] == "cube.stl":
        (tmp_path / "cube.stl").write_text("solid")
    done = typed(*words)
    assert done.returncode == EXIT_BAD_INPUT
    assert message in done.stderr
    assert {path.name for path in tmp_path.rglob("*.*")} <= {"cube.stl"}


@pytest.mark.parametrize(
    "words",
    [
        ("estimate", "--hcv", "9", "--system", "interval-type-2", "--reducer", "eiasc"),
        ("estimate", "--hcv", "9", "--sampling", "octave", "--samples", "99"),
        ("rules", "--footprint", "scaled", "--out", "a.json"),
        ("check", "paper", "--set", "tool.force=1 N"),
    ],
)
def test_a_flag_that_applies_is_none(words, typed):
    assert typed(*words).returncode == 0


VARIED = {
    "tissue.poisson_ratio": ["0", "0.25", "0.48", "0.4999", "0.49995", "0.49999"],
    "tool.radius": ["0.1 mm", "0.8 mm", "10 mm"],
    "tool.force": ["1 nN", "0.1 N", "1000 N"],
    "tool.direction": ["[0, 0, 1]", "[1, 0, 0]", "[0.9, 0.1, -0.3]"],
    "support.depth": ["1 um", "10 m"],
    "support.stiffness": ["1 Pa/m", "1e9 Pa/m", "1e12 Pa/m"],
    "lattice.spacing": ["7 mm", "15 mm", "59 mm", "100 mm"],
    "lattice.body_diagonals": ["0", "0.9"],
    "lattice.volume_term": ["true"],
    "lattice.springs": ["tetrahedra"],
    "lattice.integrator": ["velocity-verlet", "runge-kutta-4", "split-volume", "xpbd"],
    "lattice.step_fraction": ["1e-4", "0.9", "10"],
    "lattice.time_step": ["1 ms", "3 ms", "10 ms"],
    "lattice.step_rate": ["0.1 Hz", "1 MHz"],
    "damping.ratio": ["0", "100"],
    "damping.reference_spacing": ["1 um", "10 m"],
    "basafa.k1": ["1e-9 N", "1e6 N"],
    "basafa.k2": ["0 N", "1e9 N"],
    "reference.element_size": ["5 mm", "1 m"],
    "time.duration": ["1 us", "1 ms"],
    "time.samples": ["16", "31"],
    "patient.hcv": ["500 Pa", "80 kPa"],
    "fuzzy.out_of_range": ["raise", "matlab"],
}


def varied(seed):
    """A scene by name, and overrides of a few of its keys."""
    chance = random.Random(seed)
    scene = chance.choice(["block", "block", "block", "paper"])
    base = TINY if scene == "block" else ("fuzzy.sensitivity_readings=0", "time.samples=16")
    kind = chance.choice(["tissue", "basafa"]) if scene == "block" else "basafa"
    keys = chance.sample(sorted(VARIED), chance.randint(1, 3))
    chosen = [f"{key}={chance.choice(VARIED[key])}" for key in keys]
    return scene, [*base, f'models=["{kind}"]', "time.duration=0.03 s", *chosen]


def refusal(function):
    try:
        function()
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("seed", range(24))
def test_check_passes_what_runs_and_nothing_else(seed, tmp_path):
    scene, given = varied(seed)
    checked = refusal(lambda: describe_scene(scene, given, tmp_path / "out"))
    assert refusal(lambda: run_study(read_scene(scene, given))) == checked


def test_scenes_varied_by_chance_are_of_both_sorts(tmp_path):
    """Negative control of the test above: it would hold of scenes that are all refused."""
    found = [refusal(partial(describe_scene, *varied(seed), tmp_path)) for seed in range(24)]
    assert 5 <= sum(one is None for one in found) <= 19
