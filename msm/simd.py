"""Several numbers at once inside compiled kernels: vectors of 1, 2, 4 or 8 lanes.

Loops over the short rows of a grid are not vectorised by the compiler to any profit, so here the
vectors are written out: `load` and `store` move neighbouring entries of an array, and what is
loaded takes +, -, *, /, abs, min, max and mixes with plain numbers. A kernel written in these terms
knows no width: it has that of its argument `lanes`, see `lanes_of`, and with one lane its numbers
are plain ones. Products and sums may be fused where the processor can.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numba
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

Lanes = tuple[float, ...]

WIDTHS = (1, 2, 4, 8)
DOUBLE, WORD, INDEX = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
FUSED = ("contract",)
ROOT_GUESS = 0x5FE6EB50C7B537A9
"""From which half the bits of q are taken for 1 / sqrt(q), within 3.5 %: Lomont 2003."""


def lanes_of(width: int) -> Lanes:
    """The argument that tells a kernel its width; its numbers mean nothing, their count does."""
    if width not in WIDTHS:
        raise ValueError(f"vectors have {WIDTHS} lanes, not {width}")
    return (0.0,) * width


def widest() -> int:
    """Lanes that the processor computes at once, of those that numba compiles for."""
    features = numba.config.CPU_FEATURES or get_host_cpu_features()
    known = {"+avx512f": 8, "+avx": 4, "+sse2": 2, "+neon": 2}
    return max((known.get(name, 1) for name in features.split(",")), default=1)


class LanesType(types.Type):
    """The compiler's type of a vector of so many numbers."""

    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(name=f"Lanes({count})")


@register_model(LanesType)
class _LanesModel(PrimitiveModel):  # type: ignore[misc] # numba publishes no types
    def __init__(self, dmm: Any, kind: LanesType) -> None:
        super().__init__(dmm, kind, ir.VectorType(DOUBLE, kind.count))


def _kind(lanes: Any) -> Any:
    return types.float64 if lanes.count == 1 else LanesType(lanes.count)


# Memory ----------------------------------------------------------------------------------------


def _place(context: Any, builder: Any, kind: Any, array: Any, at: Any, value: Any) -> Any:
    """Where the entry (row, column) of an array stands, as vectors of a type do."""
    made = context.make_array(kind)(context, builder, array)
    columns = cgutils.unpack_tuple(builder, made.shape)[1]
    entry = builder.gep(made.data, [builder.add(builder.mul(at[0], columns), at[1])])
    return builder.bitcast(entry, context.get_value_type(value).as_pointer())


@intrinsic
def load(_: Any, array: Any, row: Any, column: Any, lanes: Any) -> Any:  # noqa: ARG001 - typed alone
    """Entries of a matrix in a row, from a column on, as many as there are lanes."""
    kind = _kind(lanes)

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place = _place(context, builder, signature.args[0], given[0], given[1:3], kind)
        return builder.load(place, align=8)

    return kind(array, types.intp, types.intp, lanes), code


@intrinsic
def store(_: Any, array: Any, row: Any, column: Any, value: Any) -> Any:  # noqa: ARG001 - typed alone
    """Set the entries of a matrix in a row, from a column on, to a vector."""

    def code(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place = _place(context, builder, signature.args[0], given[0], given[1:3], value)
        builder.store(given[3], place, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, value), code


# Numbers ---------------------------------------------------------------------------------------


def _splat(builder: Any, x: Any, count: int) -> Any:
    nothing = ir.Constant(ir.VectorType(DOUBLE, count), ir.Undefined)
    first = builder.insert_element(nothing, x, ir.Constant(INDEX, 0))
    return builder.shuffle_vector(
        first, nothing, ir.Constant(ir.VectorType(INDEX, count), [0] * count)
    )


@intrinsic
def every(_: Any, x: Any, lanes: Any) -> Any:  # noqa: ARG001 - typed alone
    """The same number in every lane."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        return given[0] if lanes.count == 1 else _splat(builder, given[0], lanes.count)

    return _kind(lanes)(types.float64, lanes), code


def _function(builder: Any, name: str, count: int, arity: int) -> Any:
    vector = ir.VectorType(DOUBLE, count)
    kind = ir.FunctionType(vector, [vector] * arity)
    return cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{count}f64")


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


def _teach_pair(function: Callable[..., Any], emit: Callable[..., Any]) -> None:
    """Let kernels apply a function of two numbers to vectors, or to a vector and a number."""

    @type_callable(function)
    def _(_: Any) -> Any:
        def typer(a: Any, b: Any) -> Any:
            vectors = [x for x in (a, b) if isinstance(x, LanesType)]
            fit = all(isinstance(x, LanesType | types.Float) for x in (a, b))
            return vectors[0] if vectors and fit and vectors[0] is vectors[-1] else None

        return typer

    def code(_: Any, builder: Any, signature: Any, given: Any) -> Any:
        count = signature.return_type.count
        both = [
            x if isinstance(kind, LanesType) else _splat(builder, x, count)
            for kind, x in zip(signature.args, given, strict=True)
        ]
        return emit(builder, *both)

    for kinds in ((LanesType, LanesType), (LanesType, types.Float), (types.Float, LanesType)):
        lower_builtin(function, *kinds)(code)


def _teach_single(function: Callable[..., Any], emit: Callable[..., Any]) -> None:
    @type_callable(function)
    def _(_: Any) -> Any:
        return lambda a: a if isinstance(a, LanesType) else None

    lower_builtin(function, LanesType)(
        lambda _, builder, signature, given: emit(builder, given[0], signature.args[0].count)
    )


for _two, _emit in PAIRED.items():
    _teach_pair(_two, _emit)
_teach_single(operator.neg, lambda builder, a, _: builder.fneg(a))
_teach_single(abs, lambda builder, a, n: builder.call(_function(builder, "fabs", n, 1), [a]))


@intrinsic
def root(_: Any, x: Any) -> Any:
    """Square root of each lane."""
    count = getattr(x, "count", 1)

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        if count > 1:
            return builder.call(_function(builder, "sqrt", count, 1), given)
        kind = ir.FunctionType(DOUBLE, [DOUBLE])
        one = cgutils.get_or_insert_function(builder.module, kind, "llvm.sqrt.f64")
        return builder.call(one, given)

    return x(x), code


@intrinsic
def root_guess(_: Any, q: Any) -> Any:
    """1 / sqrt(q) within 3.5 %, for positive normal numbers."""
    count = q.count

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        words = ir.VectorType(WORD, count)
        bits = builder.bitcast(given[0], words)
        half = builder.lshr(bits, ir.Constant(words, [1] * count))
        return builder.bitcast(
            builder.sub(ir.Constant(words, [ROOT_GUESS] * count), half), given[0].type
        )

    return q(q), code


@intrinsic
def where_not_zero(_: Any, x: Any, found: Any, other: Any) -> Any:  # noqa: ARG001 - typed alone
    """`found` in the lanes in which x is not zero (or not a number), `other` in the rest."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        zero = ir.Constant(given[0].type, None if getattr(x, "count", 1) > 1 else 0.0)
        return builder.select(builder.fcmp_unordered("!=", given[0], zero), given[1], given[2])

    return found(x, found, found), code


def inverse_root(q: Any) -> Any:
    """1 / sqrt(q) to two units in the last place, infinite for 0; for kernels only."""
    raise NotImplementedError(q)


@overload(inverse_root)
def _inverse_root(q: Any) -> Any:
    """Two steps of high order from a guess, in a third of the time of a division and a root."""
    if not isinstance(q, LanesType):

        def plain(q: Any) -> Any:
            return 1.0 / root(q)

        return plain
    lanes = lanes_of(q.count)

    def polished(q: Any) -> Any:
        y = root_guess(q)
        r = 1.0 - q * y * y
        y = y + y * (r * (0.5 + r * (0.375 + r * (0.3125 + r * 0.2734375))))
        r = 1.0 - q * y * y
        y = y + y * (r * (0.5 + r * 0.375))
        return where_not_zero(q, y, every(float("inf"), lanes))

    return polished


@intrinsic
def lane(_: Any, x: Any, n: Any) -> Any:  # noqa: ARG001 - typed alone
    """The number in one lane."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        return builder.extract_element(given[0], builder.trunc(given[1], INDEX))

    return types.float64(x, types.intp), code


@intrinsic
def with_lane(_: Any, x: Any, n: Any, value: Any) -> Any:  # noqa: ARG001 - typed alone
    """The vector with another number in one lane."""

    def code(_: Any, builder: Any, __: Any, given: Any) -> Any:
        return builder.insert_element(given[0], given[2], builder.trunc(given[1], INDEX))

    return x(x, types.intp, types.float64), code


def lanewise(function: Callable[..., Any], kind: Any) -> Callable[..., Any]:
    """A function of (law, number) as one of a number of this compiler's type: lane by lane."""
    if not isinstance(kind, LanesType):
        return function
    count, one = kind.count, register_jitable(function)

    def by_lane(law: Any, x: Any) -> Any:
        found = x
        for n in range(count):
            found = with_lane(found, n, one(law, lane(x, n)))
        return found

    return by_lane
