"""The demand on a simulation: a rate, an error, or both."""

from __future__ import annotations

from dataclasses import dataclass

from study.annotation.quantity import Quantity

RATE = Quantity("Hz", 0.1, 1e5)
ERROR = Quantity("", 1e-6, 1.0)
LENGTH = Quantity("m", 1e-9, 10.0)


@dataclass(frozen=True)
class Demand:
    """Rate [Hz] in real time, and relative error of the field; either may be open."""

    rate: float | None
    error: float | None

    def __str__(self) -> str:
        """For a reader."""
        parts = [] if self.rate is None else [f"{self.rate:g} Hz"]
        parts += [] if self.error is None else [f"an error of {100 * self.error:g} %"]
        return " and ".join(parts)


def demand(rate: str | None, error: str | None) -> Demand:
    """A demand from texts such as "60 Hz", "60 fps" or 60, and "5 %".

    ValueError if neither is given or one is invalid.
    """
    if rate is None and error is None:
        raise ValueError('give --rate, for example "60 Hz", or --error, for example "5 %", or both')
    return Demand(
        None if rate is None else _read("--rate", rate, RATE, _hertz(rate)),
        None if error is None else _read("--error", error, ERROR, _share(error)),
    )


def length(error: str | None) -> float | None:
    """An error given as a length [m], such as "0.5 mm"; None for a share, or if none is given."""
    if error is None:
        return None
    try:
        return LENGTH.read(error)
    except ValueError:
        return None


def as_share(error: float, reach: float) -> str:
    """An error [m] as a percentage of the largest displacement [m]. ValueError if it is larger."""
    if error >= reach:
        raise ValueError(
            f"--error {1e3 * error:.3g} mm: the organ moves by {1e3 * reach:.3g} mm at most under "
            "this load; ask for less"
        )
    return f"{100.0 * error / reach:.3g} %"


def _read(flag: str, given: str, quantity: Quantity, text: str) -> float:
    try:
        return quantity.read(text)
    except ValueError as problem:
        raise ValueError(f"{flag} {given}: {problem}") from None


def _hertz(text: str) -> str:
    """A bare number taken in Hz; other text unchanged."""
    try:
        return f"{float(text)!r} Hz"
    except ValueError:
        return text


def _share(text: str) -> str:
    """A percentage as a fraction; other text unchanged."""
    number = text.strip().removesuffix("%").strip()
    if not text.strip().endswith("%"):
        return text
    try:
        return repr(float(number) / 100.0)
    except ValueError:
        return text
