"""Arrays that are expensive or not reproducible, computed once for all runs that need them.

They are computed deep within a stage by code that knows no store; the store of the run is set as a
context around it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from study.stages.fingerprint import key
from study.stages.serialisation import Arrays
from study.stages.store import Store
from study.system.folders import tell


class _Current(NamedTuple):
    """The current store, and whether its content may be read."""

    store: Store
    readable: bool


_CURRENT: ContextVar[_Current | None] = ContextVar("current", default=None)


@contextmanager
def using_store(store: Store | None, *, readable: bool = True) -> Iterator[None]:
    """Within the block, keep computed arrays in a store, and read them from it if `readable`."""
    token = _CURRENT.set(None if store is None else _Current(store, readable))
    try:
        yield
    finally:
        _CURRENT.reset(token)


def kept(name: str, *given: object, modules: tuple[str, ...]) -> Arrays | None:
    """The arrays that `cached_arrays` would take from the store, None if it would compute them."""
    current, found = _CURRENT.get(), key(name, *given, modules=modules)
    if current is None or found is None or not current.readable:
        return None
    entry = current.store.get(found)
    return None if entry is None else entry.arrays


def cached_arrays(
    name: str, make: Callable[[], Arrays], *given: object, modules: tuple[str, ...]
) -> Arrays:
    """The arrays of `make`, or those stored for equal `given` and the same `modules`."""
    current, found = _CURRENT.get(), key(name, *given, modules=modules)
    if current is None or found is None:
        return make()
    store = current.store
    entry = store.get(found) if current.readable else None
    if entry is not None:
        return entry.arrays
    started = time.perf_counter()
    arrays = make()
    try:
        store.put(found, None, arrays, time.perf_counter() - started)
    except OSError as error:
        tell(f"{name}: not kept for the next run ({error})")
    return arrays
