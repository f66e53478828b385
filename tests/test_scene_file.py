"""Scenes: what is read, what is refused, and with which words."""

import codecs
import time
from dataclasses import replace

import pint
import pytest

from study.annotation.quantity import USUAL, Quantity
from study.scene.file import BUILT_IN, SceneError, read_scene, resolved, write_scene

MESH = "lattice.springs=tetrahedra"
RAYLEIGH = "damping.kind=rayleigh"
NO_BENCHMARK = 'models=["msm"]'


def written(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", BUILT_IN)
def test_resolved_scene_reads_back_unchanged(name, tmp_path):
    scene = read_scene(name)
    assert read_scene(written(tmp_path, write_scene(scene))) == scene


def test_all_problems_are_reported_at_once_with_key_and_remedy(tmp_path):
    text = """
    frobs = 1
    [tissue]
    youngs_modulus = "-5 kPa"
    posson_ratio = 0.3
    [time]
    duration = "1 mm"
    samples = 30.5
    [tool]
    history = { kind = "stp" }
    [control_points]
    tip = { fracton = [1, 2, 3] }
    """
    with pytest.raises(SceneError) as caught:
        read_scene(written(tmp_path, text))
    message = str(caught.value)
    for part in (
        "7 problems",
        "frobs: unknown key",
        "tissue.youngs_modulus: must lie between",
        "tissue.posson_ratio: unknown key, did you mean 'poisson_ratio'?",
        "time.duration: 'mm' is not a unit like s",
        "time.samples: write a whole number",
        "tool.history.kind: should be 'step'",
        "control_points.tip.fracton: unknown key, did you mean 'fraction'?",
    ):
        assert part in message


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("9.5 kPa", 9.5e3),
        ("9500", None),
        ("1e3 N/m^2", 1e3),
        ("0.01 MPa", 1e4),
        ("1e3 N/m²", 1e3),
        ("1e3 N/m2", 1e3),
        ("0.001 N/mm**2", 1e3),
        ("1e3 N·m⁻²", 1e3),
        ("1e9 µPa", 1e3),
    ],
)
def test_a_pressure_needs_its_unit(text, value):
    pressure = Quantity("Pa", 100, 1e6)
    if value is None:
        with pytest.raises(ValueError, match="unit is missing"):
            pressure.read(text)
    else:
        assert pressure.read(text) == value
        assert pressure.read(pressure.text(value)) == value


def test_units_converted_without_pint_are_as_pint_has_them():
    registry = pint.UnitRegistry()
    for unit, known in USUAL.items():
        for name, size in known.items():
            assert size == pytest.approx(registry.Quantity(1.0, name).to(unit).magnitude, rel=1e-15)


@pytest.mark.parametrize(
    "text",
    ["9**9**9 Pa", "1,5 kPa", "5 k Pa", "nan Pa", "1e400 Pa", "5 kpa", "5 mm", "10 degC", "", "Pa"],
)
def test_text_that_units_libraries_misread_is_refused_at_once(text):
    start = time.perf_counter()
    with pytest.raises(ValueError, match=r"unit|number|finite"):
        Quantity("Pa", 100, 1e6).read(text)
    assert time.perf_counter() - start < 5  # pint itself would hang on the first


@pytest.mark.parametrize("value", [True, None, [1], {"a": 1}, 10**400, float("nan")])
def test_values_that_are_no_numbers_are_refused(value):
    with pytest.raises(ValueError, match=r"number|finite"):
        Quantity("Pa", 100, 1e6).read(value)


def test_a_reading_in_the_wrong_unit_is_refused():
    """Negative control: 9.5 kPa written as 9.5 Pa must not pass for a liver."""
    with pytest.raises(SceneError, match=r"patient\.hcv: must lie between"):
        read_scene("paper", ["patient.hcv=9.5 Pa"])


def test_a_key_that_is_set_twice_has_its_last_value_and_a_remark():
    scene = read_scene("block", ["tool.force=1 N", "tool.radius=20 mm", "tool.Force=2 N"])
    assert scene.tool.force == 2.0
    assert scene.remarks == ("tool.force: set 2 times; the last counts",)


def test_overrides_take_bare_text_quoted_text_and_numbers():
    for text in ("2 N", '"2 N"', "2"):
        assert read_scene("liver", [f"tool.force={text}"]).tool.force == 2.0


@pytest.mark.parametrize("override", ["tool.force", "=1", "title.x=3", "tool..force=1"])
def test_a_malformed_override_is_refused(override):
    with pytest.raises(SceneError, match="--set"):
        read_scene("liver", [override])


@pytest.mark.parametrize(
    "text",
    ["x = " + "[" * 5000, "x = " + "9" * 900, "a = 1\na = 2", "x = 1e400 nonsense", "\ud800"],
)
def test_hostile_toml_is_refused_with_a_message(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(SceneError, match=r"scene\.toml"):
        read_scene(str(path))


def test_huge_files_and_lines_are_refused_before_parsing(tmp_path):
    for text in ("a" * 2000 + " = 1", "x = 1\n" * 20_000):
        with pytest.raises(SceneError, match=r"longer|larger"):
            read_scene(written(tmp_path, text))


def test_a_point_refuses_what_it_cannot_use():
    with pytest.raises(SceneError) as caught:
        read_scene("paper", ["lattice.spacing=5 mm", 'models=["fem"]'])
    assert "lattice: has no effect on a single point" in str(caught.value)
    assert "fem needs an organ with a mesh" in str(caught.value)


def test_an_unknown_name_suggests_a_near_one():
    with pytest.raises(SceneError, match="did you mean 'liver'"):
        read_scene("livr")


def test_a_mesh_path_is_relative_to_the_scene_that_names_it(tmp_path):
    scene = read_scene(written(tmp_path, '[organ]\nmesh = "a/b.stl"\nunit = "mm"'))
    assert scene.organ.mesh == str(tmp_path / "a/b.stl")


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["lattice.volume_term=true", "tissue.poisson_ratio=0.2"], "needs tissue.poisson_ratio"),
        (["lattice.integrator=split-volume"], "split-volume needs lattice.volume_term"),
        (["lattice.integrator=xpbd"], "xpbd takes linear springs only"),
        (["lattice.time_step=1 ms", "lattice.step_rate=1 kHz"], "contradicts lattice.step_rate"),
        (["lattice.integrator=leapfrog"], "lattice.integrator"),
        (["lattice.body_diagonals=1.0"], "lattice.body_diagonals"),
        (["lattice.springs=edges"], r"lattice\.springs: should be 'lattice' or 'tetrahedra'"),
        ([MESH, "lattice.volume_term=true"], r"lattice\.volume_term: springs on tetrahedra"),
        ([MESH, "lattice.flexion=0.1"], r"lattice\.flexion: has no effect on springs along a mesh"),
        ([MESH, "lattice.body_diagonals=0"], r"lattice\.body_diagonals: has no effect"),
    ],
)
def test_lattice_keys_that_do_not_fit_are_refused(overrides, message):
    with pytest.raises(SceneError, match=message):
        read_scene("liver", overrides)


def law(strain, relative_tension):
    return f"lattice.law={{strain={strain}, relative_tension={relative_tension}}}"


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["lattice.law=linear"], r"lattice\.law: should be a table"),
        (
            ["lattice.law={strain=[0, 1]}"],
            r"lattice\.law\.relative_tension: missing, the law piece",
        ),
        ([law([0, 1], [0, 1, 2])], r"lattice\.law: .* shapes \(2,\) and \(3,\)"),
        ([law([0], [0])], "two or more"),
        ([law([-2, 0], [-1, 0])], r"lattice\.law: no spring has a strain below -1"),
        ([law([0, 0.2, 0.1], [0, 1, 2])], r"lattice\.law: the strain .* must rise"),
        ([law([0, 0.1, 0.1], [0, 1, 2])], r"lattice\.law: the strain .* must rise"),
        (
            [law([-0.1, 0, 0.1], [-1, 0, -1])],
            r"lattice\.law: the tension .* must rise",
        ),
        ([law([0, 0.1, 0.2], [0, 1, 1])], r"lattice\.law: the tension .* must rise"),
        ([law([-0.1, 0.1], [-1, 1.5])], "free of tension at rest"),
        ([law([-0.1, 0, 0.1], [0, 0.1, 1])], "free of tension at rest"),
        (
            [law([0, 1], [0, 1]), "lattice.integrator=xpbd", NO_BENCHMARK],
            r"lattice\.law: xpbd takes",
        ),
        ([law([0, 1], [0, 1]), 'models=["fem"]'], "add msm or tissue to models"),
        ([law([0, 1], [0, 2]), "lattice.volume_term=true"], "equal to their strain"),
        ([law([-1, 0, 1], [-2, 0, 1]), "lattice.volume_term=true"], "equal to their strain"),
    ],
)
def test_a_spring_law_that_cannot_be_is_refused_by_key(overrides, message):
    with pytest.raises(SceneError, match=message):
        read_scene("liver", overrides)


def test_a_spring_law_may_soften_stiffen_and_be_steeper_on_one_side():
    """With the volume term it must only start as the linear spring."""
    given = law([-0.2, 0, 0.01, 0.1], [-0.05, 0, 0.01, 0.6])
    assert read_scene("liver", [given]).lattice.law.parameters["relative_tension"] == (
        -0.05,
        0,
        0.01,
        0.6,
    )
    linear_at_rest = law([-0.2, -0.1, 0, 0.01, 0.1], [-0.11, -0.1, 0, 0.01, 0.6])
    assert read_scene("liver", [linear_at_rest, "lattice.volume_term=true"]).lattice.law is not None


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["damping.kind=viscous"], r"damping\.kind: should be 'eq-2' or 'rayleigh'"),
        (["damping.mass=3"], r"damping\.mass: has no effect.*damping\.kind to rayleigh"),
        (["damping.stiffness=1 ms"], r"damping\.stiffness: has no effect"),
        ([RAYLEIGH], r"damping\.kind: rayleigh needs damping\.mass"),
        ([RAYLEIGH, "damping.mass=-1"], r"damping\.mass: must lie between"),
        ([RAYLEIGH, "damping.mass=1 s"], r"damping\.mass: 's' is not a unit like s\^-1"),
        ([RAYLEIGH, "damping.stiffness=1 Hz"], r"damping\.stiffness: 'Hz' is not a unit like s"),
        (
            [RAYLEIGH, "damping.stiffness=1 ms", "lattice.integrator=velocity-verlet"],
            r"damping\.stiffness: velocity-verlet has only the mass part",
        ),
    ],
)
def test_damping_that_does_not_fit_is_refused_by_key(overrides, message):
    with pytest.raises(SceneError, match=message):
        read_scene("liver", overrides)


def test_the_mass_part_suits_every_integrator_and_both_parts_the_default():
    both = [RAYLEIGH, "damping.mass=3 s^-1", "damping.stiffness=2 ms"]
    assert read_scene("liver", both).damping.stiffness == 2e-3
    only_mass = [RAYLEIGH, "damping.mass=3", "lattice.integrator=implicit-midpoint"]
    assert read_scene("liver", only_mass).damping.mass == 3.0


def test_a_point_has_no_rayleigh_damping():
    with pytest.raises(SceneError, match=r"damping\.kind: a single point"):
        read_scene("paper", [RAYLEIGH, "damping.mass=3"])


def test_what_springs_and_damping_do_not_use_is_left_out_of_the_resolved_scene():
    table = resolved(read_scene("liver", [MESH, RAYLEIGH, "damping.mass=3"]))
    assert not table["lattice"].keys() & {"spacing", "flexion", "body_diagonals", "law"}
    assert table["damping"].keys() == {"kind", "mass", "stiffness", "reference_spacing"}
    assert resolved(read_scene("liver"))["damping"].keys() == {"kind", "ratio", "reference_spacing"}


def test_scenes_are_frozen():
    scene = read_scene("liver")
    assert replace(scene, title="other") != scene
    with pytest.raises(AttributeError):
        scene.title = "other"


PLAIN = 'title = "\u00e9"\n\n[tool]\nforce = "1 N"\n'


@pytest.mark.parametrize(
    "data", [codecs.BOM_UTF8 + PLAIN.encode(), PLAIN.replace("\n", "\r\n").encode()]
)
def test_a_byte_order_mark_and_other_line_ends_change_nothing(data, tmp_path):
    path = tmp_path / "own.toml"
    path.write_bytes(data)
    assert read_scene(str(path)) == read_scene(str(_written(tmp_path, PLAIN.encode())))


def _written(folder, data):
    path = folder / "plain.toml"
    path.write_bytes(data)
    return path


TWO_TOOLS = b"""title = ""
[[tool]]
force = %b

[[tool]]
force = %b
[tool.history]
kind = "ramp"
"""


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (PLAIN.encode("utf-16"), "plain.toml: is UTF-16; save it as UTF-8"),
        (PLAIN.encode("utf-32"), "plain.toml: is UTF-32; save it as UTF-8"),
        (PLAIN.encode("latin-1"), "plain.toml, line 1: byte 0xe9 is not UTF-8"),
        (PLAIN.encode() + b'force = "2 N"\n', "line 5: .*given twice; remove one"),
        (PLAIN.encode() + b"[tool]\n", "line 5: .*the table is given twice"),
        (PLAIN.replace('"1 N"', "1 N").encode(), "line 4: .*is put in quotes"),
        (PLAIN.replace('"1 N"', "N").encode(), "line 4: .*are put in quotes"),
        (PLAIN.replace('"1 N"', '"1 N').encode(), "line 4: .*closing quote is missing"),
        (PLAIN.encode() + b"force\n", "line 5: .*not `key = value`"),
        (PLAIN.replace('"1 N"', "[1]").encode(), r"tool\.force: .* \[line 4\]"),
        (PLAIN.replace("force", "froce").encode(), r"did you mean 'force'\? \[line 4\]"),
        (PLAIN.encode() + b"[reference]\nmodes = 3\n", r"reference\.modes: .* \[line 6\]"),
        (b"time = { samples = 3 }\n", r"time\.samples: .* \[line 1\]"),
        (b"[[further_tools]]\n", r"further_tools: unknown key; write .* \[\[tool\]\] \[line 1\]"),
        (b"[[weight]]\nmass = 1\n", r"weight\.1\.place: missing; give it \[line 1\]"),
        (TWO_TOOLS % (b'"1 N"', b'"1 m"'), r"tool\.2\.force: .* \[line 6\]"),
        (TWO_TOOLS % (b'"1 m"', b'"1 N"'), r"tool\.force: .* \[line 3\]"),
        (TWO_TOOLS % (b'"1 N"', b'"1 N"\nradius = 9'), r"tool\.2\.history\.kind: .* \[line 9\]"),
    ],
)
def test_a_fault_of_a_file_is_told_by_its_line(data, message, tmp_path):
    with pytest.raises(SceneError, match=message):
        read_scene(str(_written(tmp_path, data)))


def test_each_of_several_problems_has_a_line_of_its_own(typed, tmp_path):
    path = _written(tmp_path, b'[tool]\nradius = "1 N"\nplace = { side = "up", at = [2, "x"] }\n')
    first, *rest = typed("check", path).stderr.splitlines()
    assert first == f"liver-study: {path}: 4 problems"
    assert [line.split(":")[0] for line in rest] == [
        "  tool.place.at.0",
        "  tool.place.at.1",
        "  tool.place.side",
        "  tool.radius",
    ]


CLAMPED = b"""[support]
kind = "clamped"
stiffness = "1 MPa/m"
depth = "40 mm"
"""


def test_a_key_without_effect_is_told(tmp_path):
    scene = read_scene(str(_written(tmp_path, CLAMPED)))
    assert scene.remarks == ("support.stiffness: has no effect in this scene",)
    again = read_scene(str(_written(tmp_path, write_scene(scene).encode())))
    assert again.remarks == scene.remarks
    # What a built-in scene has for its own support is not the user's.
    asked = read_scene("liver", ["support.kind=clamped", 'tool.history={kind="step", ramp="9 s"}'])
    assert asked.remarks == ("tool.history.ramp: has no effect in this scene",)
    planned = read_scene("liver", ['require={error="5 %"}', 'models=["fem"]'])
    assert [one.partition(":")[0] for one in planned.remarks] == ["models"]
    # Negative control: nothing is told of keys that have an effect, or say what is so anyway.
    held = CLAMPED.replace(b"clamped", b"foundation") + b'[tool]\nshape = "blunt"\n'
    assert read_scene(str(_written(tmp_path, held))).remarks == ()


@pytest.mark.parametrize("value", ["true", "nan", '"1.7 m/s"'])
def test_a_reading_of_a_rule_base_is_a_number(value):
    with pytest.raises(SceneError, match=r"fuzzy\.inputs\.speed: "):
        read_scene("liver", [f'fuzzy={{rule_base="own.fis", inputs={{speed={value}}}}}'])


def test_what_an_override_gives_is_on_no_line(tmp_path):
    """Negative control: the line of the value that it replaced would mislead."""
    path = str(_written(tmp_path, PLAIN.encode()))
    for override in ("tool.force=1 kg", "tool.froce=1 N"):
        with pytest.raises(SceneError) as refused:
            read_scene(path, [override])
        assert "line" not in str(refused.value)


@pytest.mark.parametrize(
    ("override", "hint"),
    [
        ("tool.radius=12 MM", "did you mean 'mm'"),
        ("tool.radius=12 Mm", "did you mean 'mm'"),
        ("organ.volume=1 ML", "did you mean 'ml'"),
        ("tissue.youngs_modulus=9 kpa", "did you mean 'kPa'"),
        ("support.stiffness=20 mpa/m", "did you mean 'MPa/m'"),
        ("tool.radius=1,5 mm", "the decimal sign is a point"),
        ("radius=12 mm", "did you mean 'support.radius' or 'tool.radius'"),
        ("tool.force=nan", "must be finite"),
        ("tool.force=-inf", "must be finite"),
        ("models=3", "should be a list"),
        ("tissue.poisson_ratio=45", 'did you mean "45 %"'),
        ("tool.place.at=[50, 50]", 'did you mean "50 %"'),
        ("lattice=3", "should be a table"),
    ],
)
def test_a_mistaken_value_or_key_is_told_what_was_meant(override, hint):
    with pytest.raises(SceneError, match=hint):
        read_scene("liver", [override])


def test_space_round_a_quantity_is_no_mistake():
    assert read_scene("liver", ['tool.radius=" 12mm "']).tool.radius == 0.012


def test_a_name_that_no_file_can_have_is_refused():
    with pytest.raises(SceneError, match="neither a file nor a built-in scene"):
        read_scene("n" * 5000)


# --- a reader's own terms ------------------------------------------------------------------------


def test_keys_are_matched_whatever_their_case_but_names_of_control_points_are_kept(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        '[Organ]\nSHAPE = "block"\n[Tool]\nForce = "2 N"\n[control_points]\n'
        'Apex = { Side = "anterior", at = [0.5, 0.5] }\n'
    )
    found = read_scene(str(path), ["Patient.HCV=9.5 kPa"])
    assert (found.organ.shape, found.tool.force, found.patient.hcv) == ("block", 2.0, 9500.0)
    assert list(found.control_points) == ["Apex"]


def test_a_key_given_in_two_cases_is_refused(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text('[tool]\nforce = "1 N"\nForce = "2 N"\n')
    with pytest.raises(SceneError, match="Force: unknown key, did you mean 'force'"):
        read_scene(str(path))


def test_a_bare_reading_is_answered_with_its_usual_unit():
    with pytest.raises(SceneError, match=r'did you mean "9\.5 kPa"'):
        read_scene("block", ["patient.hcv=9.5"])


def test_frames_per_second_are_a_rate():
    assert read_scene("block", ["require.rate=60 fps"]).require.rate == 60.0


@pytest.mark.parametrize("name", ["my liver.stl", "liver.MSH", "a.vtu"])
def test_a_mesh_given_as_a_scene_is_answered_with_how_to_give_it(name):
    with pytest.raises(SceneError, match=r"--set organ\.mesh="):
        read_scene(name)


@pytest.mark.parametrize(
    ("organ", "message"),
    [
        ('shape = "block"\nmesh = "a.stl"', "organ.shape: has no effect beside organ.mesh"),
        ('size = ["1 m", "1 m", "1 m"]\nmesh = "a.stl"', "organ.size: has no effect beside"),
        ('volume = "1 l"\nmesh = "a.stl"', "organ.volume: has no effect beside organ.mesh"),
        ('size = ["60 mm", "60 mm", "60 mm"]', "organ.size: is of the block, not of the liver"),
        ('shape = "block"\nvolume = "1 l"', "organ.volume: is of the liver, not of the block"),
    ],
)
def test_keys_of_another_organ_are_refused(tmp_path, organ, message):
    path = tmp_path / "scene.toml"
    path.write_text(f'[organ]\n{organ}\n[patient]\nhcv = "9.5 kPa"\n')
    with pytest.raises(SceneError, match=message):
        read_scene(str(path))


def test_an_organ_put_for_that_of_a_file_takes_its_keys_along(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text('[organ]\nmesh = "a.stl"\nunit = "mm"\n[patient]\nhcv = "9.5 kPa"\n')
    assert read_scene(str(path)).organ.mesh.endswith("a.stl")
    shaped = read_scene(str(path), ["organ.shape=block"]).organ
    assert (shaped.mesh, shaped.unit, shaped.shape) == (None, None, "block")
    assert read_scene("liver", ["organ.shape=block"]).organ.shape == "block"
    assert read_scene("block", ["organ.mesh=b.stl"]).organ.mesh.endswith("b.stl")
    with pytest.raises(SceneError, match=r"organ\.size: has no effect beside organ\.mesh"):
        read_scene("block", ["organ.mesh=b.stl", 'organ.size=["1 m", "1 m", "1 m"]'])
