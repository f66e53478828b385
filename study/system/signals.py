"""Signals that ask the program to stop: it unwinds, and reports so once."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

Handler = Callable[[int, FrameType | None], object]

EXIT_MACHINE = 3
"""Exit code for no disk, no memory or a signal, and for a defect, whose traceback is printed."""
NAMES = ("SIGINT", "SIGTERM", "SIGHUP")  # some are missing on some systems

_asked: list[int] = []


class Stopped(KeyboardInterrupt):
    """The program was asked to stop; the text names the signal."""


def listen(handler: Handler) -> None:
    """Install a handler for the signals that ask to stop, except for those that are ignored.

    A shell lets its background jobs ignore SIGINT, and nohup ignores SIGHUP; the program follows
    them.
    """
    for number in numbers():
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def numbers() -> list[int]:
    """Numbers of the signals that ask to stop on this system."""
    return [getattr(signal, name) for name in NAMES if hasattr(signal, name)]


def leave_at_once(number: int, _: FrameType | None) -> NoReturn:
    """Exit before anything was done, where an exception would surface within the imports."""
    _say(
        f"liver-study: {message_for(number)} before it began; there is nothing to --resume, "
        "start again"
    )
    os._exit(EXIT_MACHINE)


def stop(number: int, _: FrameType | None) -> NoReturn:
    """Raise Stopped, so that half-written folders are removed; exit at once at a second signal."""
    if _asked:
        _say("liver-study: stopped at once; the next run removes what is half-written")
        os._exit(EXIT_MACHINE)
    ask_to_stop(number)
    raise Stopped(message_for(number))


def ask_to_stop(number: int) -> None:
    """Let the program end at the next stage, as by a signal of that number.

    For a Stopped that was raised where Python swallows exceptions.
    """
    _asked.append(number)


def asked() -> bool:
    """Whether the program was asked to stop."""
    return bool(_asked)


def stop_if_asked() -> None:
    """Raise Stopped if the program was asked to stop."""
    if _asked:
        raise Stopped(message_for(_asked[0]))


def message_for(number: int) -> str:
    """The message for a signal."""
    return "interrupted" if number == signal.SIGINT else f"stopped by {signal.Signals(number).name}"


def keep_quiet() -> None:
    """Suppress Python's message on a Stopped that it swallows: the next stage raises it again."""
    shown = sys.unraisablehook

    def hook(unraisable: sys.UnraisableHookArgs) -> None:
        if not isinstance(unraisable.exc_value, Stopped):
            shown(unraisable)

    sys.unraisablehook = hook


def _say(text: str) -> None:
    """Write to the descriptor itself, since Python's streams may be in the middle of a line."""
    try:
        os.write(2, f"{text}\n".encode())
    except OSError:  # the stream is closed
        return
