"""Decorators of the compiled kernels of the package, with their cache on disk.

The index of numba's cache refers to the argument types of a kernel, a named tuple by its class. A
spring law from outside the package would make the index unreadable for a process that cannot import
the law, and edits of the law would not be noticed. Kernels with such arguments are therefore
compiled anew in each process. So are integrators from outside the package, since
`study.system.compiled` invalidates the cache in the folders of this package only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar

import numba
from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., Any])

OURS = __name__.partition(".")[0]


class _OwnTypes(FunctionCache):  # type: ignore[misc] # numba publishes no types
    """Cache on disk for kernels all of whose argument types belong to this package."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The cached kernel of a signature, None if there is none."""
        return super().load_overload(sig, target_context) if _is_ours(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Cache a kernel on disk if its argument types allow it."""
        if _is_ours(sig):
            super().save_overload(sig, data)


def _is_ours(sig: Any) -> bool:
    tuples = [kind.instance_class for kind in sig if hasattr(kind, "instance_class")]
    return all(map(_is_defined_here, tuples))


def _is_defined_here(thing: Any) -> bool:
    return bool(thing.__module__.partition(".")[0] == OURS)


def kernel(
    *,
    nogil: bool = False,
    inline: Literal["never", "always"] = "never",
    makes_arrays: bool = True,
) -> Callable[[F], F]:
    """Compile a function as a kernel, cached on disk if it belongs to this package.

    `makes_arrays=False` promises that neither the kernel nor any that it calls allocates an array,
    also not by array arithmetic. Reference counting of the many arrays of a network is then left
    out, which saves a sixth of the compilation; an array allocated nevertheless would never be
    freed. `nogil` and `inline` are those of numba. Division by zero follows IEEE 754.
    """
    return _compiled(nogil=nogil, inline=inline, _nrt=makes_arrays)


def inner_kernel(*, inline: Literal["never", "always"] = "never") -> Callable[[F], F]:
    """Compile a kernel that only other kernels call and that allocates no array.

    Without a Python wrapper and reference counting it compiles in half the time.
    """
    return _compiled(inline=inline, no_cpython_wrapper=True, _nrt=False)


def _compiled(**options: Any) -> Callable[[F], F]:
    def compiled(function: F) -> F:
        # No kernel is passed as a value, so none needs a C wrapper.
        made = numba.njit(error_model="numpy", no_cfunc_wrapper=True, **options)(function)
        if _is_defined_here(function):
            made._cache = _OwnTypes(function)  # what cache=True sets
        return made  # type: ignore[no-any-return] # numba publishes no types

    return compiled
