"""The decorators of the compiled kernels of the package.

Numba keeps the type of a kernel's arguments in an index on disk, a named tuple as the name of its
class. A spring law from outside the package would make that index unreadable for a process that
cannot import it, and an edit of it would go unseen: its kernels are compiled in each process anew.
So is an integrator from outside, for it would outlive changes of the kernels that it calls, which
`study.compiled` drops in this package's folders only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar

import numba
from numba.core.caching import FunctionCache

F = TypeVar("F", bound=Callable[..., Any])

OURS = __name__.partition(".")[0]


class _OwnTypes(FunctionCache):  # type: ignore[misc] # numba publishes no types
    """Keeps on disk the kernels whose arguments are of types of this package alone."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kept kernel of a signature, None if there is none."""
        return super().load_overload(sig, target_context) if _is_ours(sig) else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a kernel, or leave it to this process."""
        if _is_ours(sig):
            super().save_overload(sig, data)


def _is_ours(sig: Any) -> bool:
    tuples = [kind.instance_class for kind in sig if hasattr(kind, "instance_class")]
    return all(map(_stands_here, tuples))


def _stands_here(thing: Any) -> bool:
    return bool(thing.__module__.partition(".")[0] == OURS)


def kernel(
    *,
    nogil: bool = False,
    inline: Literal["never", "always"] = "never",
    makes_arrays: bool = True,
) -> Callable[[F], F]:
    """Decorate a function as a compiled kernel, kept on disk if it is this package's.

    With `makes_arrays` false neither it nor any kernel that it calls makes one, by array arithmetic
    either: then nobody counts who holds the many arrays of a network, which is a sixth of the time
    that it takes to compile. An array made all the same would never be freed. `nogil` and `inline`
    are numba's. Division by zero follows IEEE.
    """
    return _compiled(nogil=nogil, inline=inline, _nrt=makes_arrays)


def inner_kernel(*, inline: Literal["never", "always"] = "never") -> Callable[[F], F]:
    """Decorate a kernel that other kernels call, and nothing else, and that makes no array.

    It takes half as long to compile: Python needs no way into it, and nobody counts who holds the
    arrays that it is given.
    """
    return _compiled(inline=inline, no_cpython_wrapper=True, _nrt=False)


def _compiled(**options: Any) -> Callable[[F], F]:
    def compiled(function: F) -> F:
        # The way in from C is left out: no kernel is handed on as a value.
        made = numba.njit(error_model="numpy", no_cfunc_wrapper=True, **options)(function)
        if _stands_here(function):
            made._cache = _OwnTypes(function)  # what cache=True sets
        return made  # type: ignore[no-any-return] # numba publishes no types

    return compiled
