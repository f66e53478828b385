"""Explicit SIMD in compiled kernels: vectors of doubles, or of twice as many singles.

The compiler does not vectorise loops over the short rows of a grid profitably, so vectors are
explicit: `load` and `store` move neighbouring entries of an array, and vectors support +, -, *, /,
abs, min and max, also with scalars. A kernel is independent of width and precision, which come from
its argument `lanes` (`lanes_of`); with one lane its numbers are plain doubles. Scalars are rounded
to the precision of the vector. Multiplication and addition may be fused where the processor can.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.codegen import get_host_cpu_features
from numba.core.datamodel import PrimitiveModel
from numba.extending import (
    intrinsic,
    lower_builtin,
    overload,
    register_jitable,
    register_model,
    type_callable,
)
from numpy.typing import NDArray

Lanes = tuple[float | np.float32, ...]

WIDTHS = (1, 2, 4, 8)
"""Widths of vectors of doubles; vectors of singles are twice as wide."""
CACHE_LINE = 64
"""Bytes that the processor reads at once; a vector is never longer."""
INDEX = ir.IntType(32)
FUSED = ("contract",)


class Format(NamedTuple):
    """A floating-point format of the compiler: its name and its type."""

    name: str
    number: Any


FORMATS = {
    types.float64: Format("f64", ir.DoubleType()),
    types.float32: Format("f32", ir.FloatType()),
}


def lanes_of(width: int, *, single: bool = False) -> Lanes:
    """The argument that determines the vector width and precision of a kernel by its type.

    Its values are not used.
    """
    widths = tuple(2 * n for n in WIDTHS) if single else WIDTHS
    if width not in widths:
        raise ValueError(f"vectors have {widths} lanes, not {width}")
    return (np.float32(0.0) if single else 0.0,) * width


def widest() -> int:
    """Vector width in doubles of the processor that numba compiles for."""
    known = {"+avx512f": 8, "+avx": 4, "+sse2": 2, "+neon": 2}
    return max(known.get(name, 1) for name in _features())


def _features() -> list[str]:
    """Names of what the processor that numba compiles for can do, each after a plus sign."""
    features: str = numba.config.CPU_FEATURES or get_host_cpu_features()
    return features.split(",")


class LanesType(types.Type):
    """Numba type of a vector of numbers of one type."""

    def __init__(self, count: int, dtype: Any) -> None:
        self.count, self.dtype = count, dtype
        super().__init__(name=f"Lanes({count} x {dtype})")

    @property
    def format(self) -> Format:
        """Floating-point format of the numbers."""
        return FORMATS[self.dtype]


@register_model(LanesType)
class _LanesModel(PrimitiveModel):  # type: ignore[misc] # numba publishes no types
    def __init__(self, dmm: Any, kind: LanesType) -> None:
        super().__init__(dmm, kind, ir.VectorType(kind.format.number, kind.count))


def _kind(lanes: Any) -> Any:
    return lanes.dtype if lanes.count == 1 else LanesType(lanes.count, lanes.dtype)


# Memory ----------------------------------------------------------------------------------------


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any, value: Any) -> Any:
    """Address of the entry (row, column) of an array, as a pointer to vectors of a type."""
    made = context.make_array(kind)(context, builder, array)
    columns = cgutils.unpack_tuple(builder, made.shape)[1]
    entry = builder.gep(made.data, [builder.add(builder.mul(at[0], columns), at[1])])
    return builder.bitcast(entry, context.get_value_type(value).as_pointer())


@intrinsic
def load(_: Any, array: Any, row: Any, column: Any, lanes: Any) -> Any:  # noqa: ARG001 - typed alone
    """Vector of the entries of a matrix in a row, from a column on."""
    if array.dtype is not lanes.dtype:
        return None
    kind = _kind(lanes)

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place = _place(context, builder, signature.args[0], given[0], given[1:3], kind)
        return builder.load(place, align=lanes.dtype.bitwidth // 8)

    return kind(array, types.intp, types.intp, lanes), code


@intrinsic
def store(_: Any, array: Any, row: Any, column: Any, value: Any) -> Any:  # noqa: ARG001 - typed alone
    """Set the entries of a matrix in a row, from a column on, to a vector."""
    if array.dtype is not getattr(value, "dtype", value):
        return None

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place = _place(context, builder, signature.args[0], given[0], given[1:3], value)
        builder.store(given[3], place, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, value), code


# Numbers ---------------------------------------------------------------------------------------


def _splat(context: Any, builder: Any, x: Any, plain: Any, kind: LanesType) -> Any:
    """A scalar in every lane of a vector, rounded to its precision."""
    x, count = context.cast(builder, x, plain, kind.dtype), kind.count
    nothing = ir.Constant(ir.VectorType(kind.format.number, count), ir.Undefined)
    first = builder.insert_element(nothing, x, ir.Constant(INDEX, 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(INDEX, count), [0] * count)
    )


def zeros(shape: tuple[int, int]) -> NDArray[np.float64]:
    """A matrix of zeros that begins on a cache line.

    In rows of one vector no load then spans two lines, which takes twice the time.
    """
    size = 8 * int(np.prod(shape))
    data = np.zeros(size + CACHE_LINE, dtype=np.uint8)
    ahead = -data.ctypes.data % CACHE_LINE
    return data[ahead : ahead + size].view(np.float64).reshape(shape)


@intrinsic
def every(_: Any, x: Any, lanes: Any) -> Any:  # noqa: ARG001 - typed alone
    """The same number in every lane."""
    kind = _kind(lanes)

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        if lanes.count == 1:
            return given[0]
        return _splat(context, builder, given[0], signature.args[0], kind)

    return kind(types.float64, lanes), code


def _function(builder: Any, name: str, kind: LanesType) -> Any:
    """An intrinsic function of the compiler for a vector."""
    vector = ir.VectorType(kind.format.number, kind.count)
    full_name = f"llvm.{name}.v{kind.count}{kind.format.name}"
    return cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(vector, [vector]), full_name
    )


def _fused(name: str) -> Callable[..., Any]:
    return lambda builder, a, b: getattr(builder, name)(a, b, flags=FUSED)


def _lesser(test: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(test, b, a), b, a)


PAIRED: dict[Callable[..., Any], Callable[..., Any]] = {
    operator.add: _fused("fadd"),
    operator.sub: _fused("fsub"),
    operator.mul: _fused("fmul"),
    operator.truediv: _fused("fdiv"),
    min: _lesser("<"),
    max: _lesser(">"),
}


def _register_pair(function: Callable[..., Any], emit: Callable[..., Any]) -> None:
    """Define a binary function for two vectors, or for a vector and a scalar."""

    @type_callable(function)
    def _(_: Any) -> Any:
        def typer(a: Any, b: Any) -> Any:
            vectors = [x for x in (a, b) if isinstance(x, LanesType)]
            fit = all(isinstance(x, LanesType | types.Float) for x in (a, b))
            return vectors[0] if vectors and fit and vectors[0] is vectors[-1] else None

        return typer

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        vector = signature.return_type
        both = [
            x if isinstance(kind, LanesType) else _splat(context, builder, x, kind, vector)
            for kind, x in zip(signature.args, given, strict=True)
        ]
        return emit(builder, *both)

    for kinds in ((LanesType, LanesType), (LanesType, types.Float), (types.Float, LanesType)):
        lower_builtin(function, *kinds)(code)


def _register_single(function: Callable[..., Any], emit: Callable[..., Any]) -> None:
    @type_callable(function)
    def _(_: Any) -> Any:
        return lambda a: a if isinstance(a, LanesType) else None

    lower_builtin(function, LanesType)(
        lambda _, builder, signature, given: emit(builder, given[0], signature.args[0])
    )


for _two, _emit in PAIRED.items():
    _register_pair(_two, _emit)
_register_single(operator.neg, lambda builder, a, _: builder.fneg(a))
_register_single(abs, lambda builder, a, kind: builder.call(_function(builder, "fabs", kind), [a]))


@intrinsic
def root(_: Any, x: Any) -> Any:
    """Square root of each lane."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        if isinstance(x, LanesType):
            return builder.call(_function(builder, "sqrt", x), given)
        number = FORMATS[x].number
        kind = ir.FunctionType(number, [number])
        name = f"llvm.sqrt.{FORMATS[x].name}"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), given)

    return x(x), code


@intrinsic
def root_estimate(_: Any, q: Any) -> Any:
    """1 / sqrt(q) within 2^-14, not finite for 0; for processors that `_estimates_root` of q."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        vector, mask = given[0].type, ir.IntType(8)
        kind = ir.FunctionType(vector, [vector, vector, mask])
        name = f"llvm.x86.avx512.rsqrt14.pd.{64 * q.count}"
        estimate = cgutils.get_or_insert_function(builder.module, kind, name)
        every_lane = ir.Constant(mask, 255)
        return builder.call(estimate, [given[0], given[0], every_lane])

    return q(q), code


def _estimates_root(q: Any) -> bool:
    """Whether the processor has an instruction for it, from the numba type of q."""
    if not isinstance(q, LanesType) or q.dtype is not types.float64:
        return False
    needed = {8: "+avx512f", 4: "+avx512vl"}.get(q.count)
    return needed in _features()


@intrinsic
def where_not_zero(_: Any, x: Any, found: Any, other: Any) -> Any:  # noqa: ARG001 - typed alone
    """`found` in the lanes in which x is not zero (or not a number), `other` in the rest."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        zero = ir.Constant(given[0].type, None if getattr(x, "count", 1) > 1 else 0.0)
        return builder.select(builder.fcmp_unordered("!=", given[0], zero), given[1], given[2])

    return found(x, found, found), code


def inverse_root(q: Any) -> Any:
    """1 / sqrt(q) to two units in the last place, not finite for 0; for kernels only."""
    raise NotImplementedError(q)


@overload(inverse_root)
def _inverse_root(q: Any) -> Any:
    return _polished if _estimates_root(q) else _divided


def _divided(q: Any) -> Any:
    # Iterations from a guess occupy the pipelines that the rest of a kernel needs; root and
    # division have their own.
    return 1.0 / root(q)


def _polished(q: Any) -> Any:
    return polished(q, root_estimate(q))


@register_jitable
def polished(q: Any, y: Any) -> Any:
    """1 / sqrt(q) from an estimate y within 2^-14, by the series of 1 / sqrt(1 - r)."""
    r = 1.0 - q * y * y
    return y + y * (r * (0.5 + r * (0.375 + r * 0.3125)))


@intrinsic
def lane(_: Any, x: Any, n: Any) -> Any:  # noqa: ARG001 - typed alone
    """The number in one lane, as a double."""

    def code(context: Any, builder: Any, __: Any, given: Any) -> Any:
        found = builder.extract_element(given[0], builder.trunc(given[1], INDEX))
        return context.cast(builder, found, x.dtype, types.float64)

    return types.float64(x, types.intp), code


@intrinsic
def with_lane(_: Any, x: Any, n: Any, value: Any) -> Any:  # noqa: ARG001 - typed alone
    """The vector with another number in one lane, rounded to its precision."""

    def code(context: Any, builder: Any, __: Any, given: Any) -> Any:
        number = context.cast(builder, given[2], types.float64, x.dtype)
        return builder.insert_element(given[0], number, builder.trunc(given[1], INDEX))

    return x(x, types.intp, types.float64), code


@intrinsic
def one_later(_: Any, before: Any, now: Any) -> Any:  # noqa: ARG001 - typed alone
    """The last lane of a vector, then all but the last of the next."""
    count = getattr(now, "count", 1)
    lanes = list(range(count - 1, 2 * count - 1))

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        if count == 1:
            return given[0]
        order = ir.Constant(ir.VectorType(INDEX, count), lanes)
        return builder.shuffle_vector(given[0], given[1], order)

    return now(now, now), code


def lanewise(function: Callable[..., Any], kind: Any) -> Callable[..., Any]:
    """A function of (law, scalar), applied to each lane of a vector."""
    if not isinstance(kind, LanesType):
        return function
    count, one = kind.count, register_jitable(function)

    def by_lane(law: Any, x: Any) -> Any:
        found = x
        for n in range(count):
            found = with_lane(found, n, one(law, lane(x, n)))
        return found

    return by_lane
