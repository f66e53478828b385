"""Vectors inside kernels: at every width the numbers of plain numpy."""

import os
import platform
import subprocess
import sys

import numpy as np
import pytest
from numba import config
from numba.core.errors import TypingError

from msm import simd
from msm.kernel import kernel
from msm.simd import (
    WIDTHS,
    every,
    inverse_root,
    lanes_of,
    load,
    one_later,
    root,
    store,
    where_not_zero,
)


@kernel()
def compute(lanes, a, b, out):
    """Everything that vectors can do, a row each, on the columns from 1 on."""
    for i in range(1, a.shape[1] - len(lanes) + 1, len(lanes)):
        x, y = load(a, 1, i, lanes), load(b, 0, i, lanes)
        store(out, 0, i, x + y)
        store(out, 1, i, 2.0 - x * y)
        store(out, 2, i, x / y / 3.0)
        store(out, 3, i, -abs(x))
        store(out, 4, i, min(x, y))
        store(out, 5, i, max(x, 0.25))
        store(out, 6, i, root(y) + every(1.0, lanes))
        store(out, 7, i, inverse_root(y))
        store(out, 8, i, where_not_zero(load(a, 0, i, lanes), x, y))


def wanted(a, b):
    x, y = a[1], b[0]
    return np.stack(
        [
            x + y,
            2.0 - x * y,
            x / y / 3.0,
            -np.abs(x),
            np.minimum(x, y),
            np.maximum(x, 0.25),
            np.sqrt(y) + 1.0,
            1.0 / np.sqrt(y),
            np.where(a[0] != 0.0, x, y),
        ]
    )


@pytest.mark.parametrize(
    ("width", "single"), [*((width, False) for width in WIDTHS), (2, True), (16, True)]
)
def test_every_width_computes_what_numpy_does(width, single):
    rng = np.random.default_rng(0)
    kind = np.float32 if single else np.float64
    a, b = rng.standard_normal((2, 17)), np.exp(rng.uniform(-9.0, 9.0, (3, 17)))
    a[0, ::3] = 0.0
    a, b, out = a.astype(kind), b.astype(kind), np.zeros((9, 17), kind)
    compute(lanes_of(width, single=single), a, b, out)
    one = 4.0 * np.finfo(kind).eps
    np.testing.assert_allclose(out[:, 1:], wanted(a, b)[:, 1:], rtol=one, atol=one)
    assert (out[:, 0] == 0.0).all()  # before the column that it began at


def test_numbers_of_another_precision_than_the_lanes_are_refused():
    """Not read as what they are not."""
    a = np.ones((3, 17))
    with pytest.raises(TypingError):
        compute(lanes_of(4, single=True), a, a, a)


@kernel()
def later(lanes, a, b, out):
    store(out, 0, 0, one_later(load(a, 0, 0, lanes), load(b, 0, 0, lanes)))


@pytest.mark.parametrize("width", WIDTHS)
def test_neighbouring_vectors_are_read_one_lane_later(width):
    numbers = np.arange(2.0 * width)[None]
    found = np.zeros((1, width))
    later(lanes_of(width), numbers[:, :width].copy(), numbers[:, width:].copy(), found)
    assert found[0].tolist() == numbers[0, width - 1 : -1].tolist()


@pytest.mark.parametrize("shape", [(1, 1), (333, 4), (100_000, 8)])
def test_matrices_of_vectors_begin_on_a_cache_line(shape):
    found = simd.zeros(shape)
    assert found.shape == shape
    assert found.ctypes.data % simd.CACHE_LINE == 0
    assert not found.any()
    found[:] = 1.0  # its own memory


@kernel()
def roots(lanes, q, out):
    for i in range(0, q.shape[1], len(lanes)):
        store(out, 0, i, inverse_root(load(q, 0, i, lanes)))


@pytest.mark.parametrize("width", WIDTHS)
def test_the_inverse_root_is_that_of_ieee_to_two_units(width):
    q = np.exp(np.linspace(-500.0, 500.0, 80_000))[None]
    found = np.empty_like(q)
    roots(lanes_of(width), q, found)
    assert np.abs(found * np.sqrt(q) - 1.0).max() < 5e-16
    special = np.array([[0.0, np.nan, -0.0, 1.0] * 2])
    found = np.empty_like(special)
    roots(lanes_of(width), special, found)
    assert not np.isfinite(found[0, :3]).any()
    assert found[0, 3] == 1.0


@pytest.mark.parametrize("error", [-(2.0**-14), 0.0, 2.0**-14])
def test_an_estimate_is_polished_to_the_same_two_units(error):
    q = np.exp(np.linspace(-500.0, 500.0, 80_000))
    found = simd.polished(q, (1.0 + error) / np.sqrt(q))
    assert np.abs(found * np.sqrt(q) - 1.0).max() < 5e-16


AVX_512 = """
import numba
import numpy as np

from msm.kernel import kernel
from msm.simd import inverse_root, lanes_of, load, store


@kernel()
def roots(lanes, q):
    store(q, 0, 0, inverse_root(load(q, 0, 0, lanes)))


for width in (4, 8):
    roots.compile((numba.typeof(lanes_of(width)), numba.float64[:, ::1]))
    print("vrsqrt14pd" in roots.inspect_asm()[roots.signatures[-1]])
"""


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="another processor")
def test_the_estimate_of_avx_512_is_compiled_for_processors_that_have_it():
    """Compiled alone, so that it is tested on all others too; those that have it run it above."""
    processor = {
        "NUMBA_CPU_NAME": "x86-64-v4",
        "NUMBA_CPU_FEATURES": "+avx512f,+avx512vl,+avx,+sse2",
    }
    done = subprocess.run(
        [sys.executable, "-c", AVX_512],
        env=os.environ | processor,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["True", "True"]


@pytest.mark.parametrize(
    ("features", "width"),
    [("+avx512f,+avx,+sse2", 8), ("+avx,-avx512f,+sse2", 4), ("+sse2", 2), ("-neon", 1)],
)
def test_the_width_is_that_of_what_numba_compiles_for(monkeypatch, features, width):
    monkeypatch.setattr(config, "CPU_FEATURES", features)
    assert simd.widest() == width


def test_other_widths_are_refused():
    with pytest.raises(ValueError, match=r"1, 2, 4, 8.*not 3"):
        lanes_of(3)
    with pytest.raises(ValueError, match=r"2, 4, 8, 16.*not 1"):
        lanes_of(1, single=True)
