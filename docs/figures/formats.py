"""Numbers and tables as the pages print them."""

import math
from collections.abc import Callable, Iterable, Sequence


def percent(share: float | str) -> str:
    """A share of one in per cent, to two digits and at most to a tenth."""
    value = 100 * float(share)
    if value >= 20:
        return f"{value:.0f} %"
    return f"{value:.1f} %" if value >= 0.1 else f"{value:.1g} %"


def tenths(share: float | str) -> str:
    """A share of one in per cent, to a tenth."""
    return f"{100 * float(share):.1f} %"


def two_digits(number: str) -> str:
    """A number to two digits, without an exponent."""
    return f"{float(f'{float(number):.2g}'):g}"


def rounded_up(text: str, factor: float = 1.0) -> str:
    """A number to two digits, rounded up so that a bound remains a bound."""
    value = factor * float(text)
    if value == 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"


def count(number: float | str) -> str:
    """A count in groups of three digits."""
    return f"{int(number):,}".replace(",", " ")


def kilopascals(pascals: str) -> str:
    """A modulus in kPa, to a tenth."""
    return f"{float(pascals) / 1e3:.1f}"


def millimetres(metres: float | str) -> str:
    """A length in mm, to two digits."""
    return f"{1e3 * float(metres):.2g} mm"


def seconds(times: Iterable[float]) -> str:
    """Least and largest of some times [s]."""
    found = sorted(times)
    least, most = (f"{one:.0f}" if one >= 2.0 else f"{one:.1f}" for one in (found[0], found[-1]))
    return f"{least} s" if least == most else f"{least} to {most} s"


def span(values: Iterable[float], form: Callable[[float], str] = "{:.1f}".format) -> str:
    """The least and the largest: "a to b", or "a" where they read the same."""
    ordered = sorted(values)
    least, largest = form(ordered[0]), form(ordered[-1])
    return largest if least == largest else f"{least.removesuffix(' %')} to {largest}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown, with an empty line before and after."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n\n" + "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n\n"
