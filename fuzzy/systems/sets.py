"""Fuzzy sets: a membership function and its footprint of uncertainty.

Kinds and the order of their parameters are those of MATLAB's `.fis` files, which Octave and
scikit-fuzzy share: a Gaussian is (sd, centre). So is what becomes of odd parameters: the sign of a
width does not count, equal corners are a step or a spike, an S or a Z in falling order is a step
half-way. A Gaussian without width is a spike, where Octave has no number at the centre.

A footprint bounds the displacement of the function from its principal form. The upper and lower
memberships are the largest and smallest values over the footprint. Every function with a footprint
increases to a core, where it is 1, and decreases after it, so both have closed forms for all kinds.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import exp, log, log1p
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Parameters = tuple[float, ...]
Kind = Literal[
    "gaussmf",
    "gauss2mf",
    "trimf",
    "trapmf",
    "gbellmf",
    "sigmf",
    "dsigmf",
    "psigmf",
    "zmf",
    "smf",
    "pimf",
    "linzmf",
    "linsmf",
    "constant",
    "linear",
]
NO_WIDTH = float(np.finfo(np.float64).tiny)
"""Width of a spike, with membership at its centre only."""
FUNCTION_KINDS: tuple[Kind, ...] = ("constant", "linear")
"""Consequents of Sugeno systems: numbers, not sets."""


@dataclass(frozen=True)
class Footprint:
    """Footprint of uncertainty about the principal membership function; zero for a type-1 set.

    `mean`: half-width of the uncertain position, in the variable's unit. `spread`: half-width of
    the uncertain width of its flanks over that width, below 1. `scale` and `lag` lower the lower
    membership to scale (mu - lag) / (1 - lag), 0 where mu < lag: it starts to rise where the upper
    one reaches the lag, as MATLAB describes its LowerScale and LowerLag; the form between is ours.
    """

    mean: float = 0.0
    spread: float = 0.0
    scale: float = 1.0
    lag: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.mean < np.inf:
            raise ValueError(f"footprint mean {self.mean}: give a half-width of 0 or more")
        if not 0 <= self.spread < 1:
            raise ValueError(f"footprint spread {self.spread}: give a fraction from 0 to below 1")
        if not 0 < self.scale <= 1:
            raise ValueError(f"footprint scale {self.scale}: give a number above 0, at most 1")
        if not 0 <= self.lag < 1:
            raise ValueError(f"footprint lag {self.lag}: give a number from 0 to below 1")


TYPE_1 = Footprint()


@dataclass(frozen=True)
class FuzzySet:
    """A named set on one variable, in the variable's unit; `parameters` in the order of FORMS.

    A `constant` or `linear` one is a consequent of a Sugeno system: linear takes one coefficient
    per input and then the constant.
    """

    name: str
    kind: Kind
    parameters: Parameters
    footprint: Footprint = TYPE_1

    def __post_init__(self) -> None:
        kinds = (*FORMS, *FUNCTION_KINDS)
        if self.kind not in kinds:
            raise ValueError(
                f"set {self.name!r}: kind {self.kind!r} is none of MATLAB's, and functions of "
                f"one's own are no part of a file; use {', '.join(kinds)}"
            )
        _check_parameters(self)
        _check_footprint(self)

    @property
    def shape(self) -> Parameters:
        """The parameters as arguments of the function, without irrelevant signs."""
        return FORMS[self.kind].plain(self.parameters)


def _check_parameters(one: FuzzySet) -> None:
    if not np.isfinite(one.parameters).all():
        raise ValueError(f"set {one.name!r}: parameters {one.parameters}: give finite numbers")
    if one.kind in FUNCTION_KINDS:
        if one.kind == "constant" and len(one.parameters) != 1:
            raise ValueError(f"set {one.name!r}: a constant takes 1 parameter")
        return
    form = FORMS[one.kind]
    names = form.parameters.split()
    if len(one.parameters) != len(names):
        raise ValueError(
            f"set {one.name!r}: {one.kind} takes {len(names)} parameters ({', '.join(names)}), "
            f"got {len(one.parameters)}"
        )
    if not form.valid(one.parameters):
        raise ValueError(
            f"set {one.name!r}: parameters {one.parameters} do not form a {one.kind}; "
            f"{REMEDIES[one.kind]}"
        )


def _check_footprint(one: FuzzySet) -> None:
    if one.footprint == TYPE_1:
        return
    if one.kind in FUNCTION_KINDS:
        raise ValueError(f"set {one.name!r}: a {one.kind} consequent takes no footprint")
    moved, widened = one.footprint.mean > 0, one.footprint.spread > 0
    if not has_core(one) and (moved or widened):
        raise ValueError(
            f"set {one.name!r}: a {one.kind} of {one.parameters} has no core to move or widen; "
            "use scale and lag"
        )
    if one.kind == "sigmf" and widened:
        raise ValueError(
            f"set {one.name!r}: a sigmf has no core to widen about; use mean, or scale and lag"
        )


def gaussian(x: Array, sd: float, centre: float) -> Array:
    """exp(-(x - centre)^2 / 2 sd^2)."""
    with np.errstate(over="ignore"):  # exp(-inf) is the 0 that it should be
        return np.asarray(np.exp(-0.5 * ((x - centre) / sd) ** 2))


def _ramp(x: Array, foot: float, top: float) -> Array:
    """0 before foot and 1 after top, ascending or descending; a step with value 1 at foot = top."""
    if foot == top:
        return np.ones_like(x)
    return np.clip((x - foot) / (top - foot), 0.0, 1.0)


def _trapezoid(x: Array, a: float, b: float, c: float, d: float) -> Array:
    return _inside(x, a, d, np.minimum(_ramp(x, a, b), _ramp(x, d, c)))


def _inside(x: Array, low: float, high: float, mu: Array) -> Array:
    """Mu between the feet and 0 beyond them, where a vertical flank would leave it at 1."""
    return np.where((x >= low) & (x <= high), mu, 0.0)


def _sigmoid(x: Array, slope: float, centre: float) -> Array:
    # Neither overflows far from the centre nor loses digits in its tail, as 1 / (1 + exp) would.
    return np.asarray(np.exp(-np.logaddexp(0.0, -slope * (x - centre))))


def _spline(x: Array, foot: float, top: float) -> Array:
    """Two parabolas from 0 at foot to 1 at top, ascending or descending."""
    t = _ramp(x, foot, top)
    return np.where(t < 0.5, 2.0 * t**2, 1.0 - 2.0 * (1.0 - t) ** 2)


def _pi(x: Array, a: float, b: float, c: float, d: float) -> Array:
    # MATLAB's product of an S and a Z, which is their minimum unless the tops cross.
    return _inside(x, a, d, _spline(x, a, b) * _spline(x, d, c))


def _two_sided(x: Array, p: Parameters) -> Array:
    return gaussian(np.minimum(x, p[1]), p[0], p[1]) * gaussian(np.maximum(x, p[3]), p[2], p[3])


def _bell(x: Array, half_width: float, slope: float, centre: float) -> Array:
    with np.errstate(over="ignore", divide="ignore"):  # 1 / inf is the 0 that it should be
        return 1.0 / (1.0 + np.abs((x - centre) / half_width) ** (2.0 * slope))


def _rising(p: Parameters) -> bool:
    return list(p) == sorted(p)


def _always(_: Parameters) -> bool:
    return True


def _as_given(p: Parameters) -> Parameters:
    return p


def _width(width: float) -> float:
    """The absolute width; NO_WIDTH for 0."""
    return abs(width) or NO_WIDTH


def _flank(foot: float, top: float) -> Parameters:
    """A rising flank, (foot, top); in falling order MATLAB has a step half-way between."""
    return (foot, top) if foot < top else (0.5 * (foot + top),) * 2


def _linear_z(p: Parameters) -> Parameters:
    """Top and foot; at a step the foot itself is 0, unlike that of all other kinds."""
    return p if p[0] < p[1] else (float(np.nextafter(p[0], -np.inf)),) * 2


class MembershipForm(NamedTuple):
    """One kind: names of its parameters, when they are valid, the function, ends of its core.

    Function and core take the `plain` parameters; `peaks` says whether these reach 1 at a core.
    """

    parameters: str
    valid: Callable[[Parameters], bool]
    function: Callable[[Array, Parameters], Array]
    core: Callable[[Parameters], tuple[float, float]] | None
    plain: Callable[[Parameters], Parameters] = _as_given
    peaks: Callable[[Parameters], bool] = _always


FORMS: dict[str, MembershipForm] = {
    "gaussmf": MembershipForm(
        "sd centre",
        _always,
        lambda x, p: gaussian(x, *p),
        lambda p: (p[1], p[1]),
        lambda p: (_width(p[0]), p[1]),
    ),
    "gauss2mf": MembershipForm(
        "sd_left centre_left sd_right centre_right",
        _always,
        _two_sided,
        lambda p: (p[1], p[3]),
        lambda p: (_width(p[0]), p[1], _width(p[2]), p[3]),
        lambda p: p[1] <= p[3],
    ),
    "trimf": MembershipForm(
        "foot_left peak foot_right",
        _rising,
        lambda x, p: _trapezoid(x, p[0], p[1], p[1], p[2]),
        lambda p: (p[1], p[1]),
    ),
    "trapmf": MembershipForm(
        "foot_left top_left top_right foot_right",
        lambda p: p[0] <= p[1] and p[2] <= p[3],
        lambda x, p: _trapezoid(x, *p),
        lambda p: (p[1], p[2]),
        peaks=lambda p: p[1] <= p[2],
    ),
    "gbellmf": MembershipForm(
        "half_width slope centre",
        lambda p: p[0] != 0,
        lambda x, p: _bell(x, *p),
        lambda p: (p[2], p[2]),
        lambda p: (abs(p[0]), p[1], p[2]),
        lambda p: p[1] > 0,
    ),
    "sigmf": MembershipForm(
        "slope centre",
        _always,
        lambda x, p: _sigmoid(x, *p),
        lambda p: (np.inf, np.inf) if p[0] > 0 else (-np.inf, -np.inf),
        peaks=lambda p: p[0] != 0,
    ),
    "dsigmf": MembershipForm(
        "slope_1 centre_1 slope_2 centre_2",
        _always,
        lambda x, p: np.abs(_sigmoid(x, p[0], p[1]) - _sigmoid(x, p[2], p[3])),
        None,
    ),
    "psigmf": MembershipForm(
        "slope_1 centre_1 slope_2 centre_2",
        _always,
        lambda x, p: _sigmoid(x, p[0], p[1]) * _sigmoid(x, p[2], p[3]),
        None,
    ),
    "zmf": MembershipForm(
        "top foot",
        _always,
        lambda x, p: _inside(x, -np.inf, p[1], _spline(x, p[1], p[0])),
        lambda p: (-np.inf, p[0]),
        lambda p: _flank(*p),
    ),
    "smf": MembershipForm(
        "foot top",
        _always,
        lambda x, p: _inside(x, p[0], np.inf, _spline(x, p[0], p[1])),
        lambda p: (p[1], np.inf),
        lambda p: _flank(*p),
    ),
    "pimf": MembershipForm(
        "foot_left top_left top_right foot_right",
        _always,
        lambda x, p: _pi(x, *p),
        lambda p: (p[1], p[2]),
        lambda p: (*_flank(*p[:2]), *_flank(*p[2:])),
        lambda p: p[1] <= p[2],
    ),
    "linzmf": MembershipForm(
        "top foot",
        _rising,
        lambda x, p: _inside(x, -np.inf, p[1], _ramp(x, p[1], p[0])),
        lambda p: (-np.inf, p[0]),
        _linear_z,
    ),
    "linsmf": MembershipForm(
        "foot top",
        _rising,
        lambda x, p: _inside(x, p[0], np.inf, _ramp(x, p[0], p[1])),
        lambda p: (p[1], np.inf),
    ),
}
"""Every kind of membership function, by its name in `.fis` files."""


REMEDIES: dict[str, str] = {
    **dict.fromkeys(("trimf", "linzmf", "linsmf"), "give corners in rising order"),
    "trapmf": "give both feet outside their tops",
    "gbellmf": "give a half-width other than 0, as MATLAB and Octave ask; trimf [c c c] is a spike",
}
"""Remedies for invalid parameters, by kind."""


def has_core(one: FuzzySet) -> bool:
    """Whether the membership increases to 1 and then decreases, either possibly asymptotically."""
    form = FORMS[one.kind]
    return form.core is not None and form.peaks(one.shape)


def core(one: FuzzySet) -> tuple[float, float]:
    """Ends of the interval where the membership is 1; infinite where it is open."""
    ends = FORMS[one.kind].core
    if ends is None or not has_core(one):
        raise ValueError(f"set {one.name!r}: a {one.kind} of {one.parameters} has no core")
    return ends(one.shape)


def corners(one: FuzzySet) -> tuple[float, ...]:
    """Positions where the function, or a bound of its footprint, is not smooth or may be steep."""
    p, shift, widths = one.shape, one.footprint.mean, one.footprint.spread
    places: tuple[float, ...]
    match one.kind:
        case "pimf" | "zmf" | "smf":
            places = (*p, 0.5 * (p[0] + p[1]), 0.5 * (p[-2] + p[-1]))
        case "trimf" | "trapmf" | "linzmf" | "linsmf":
            places = p if has_core(one) else (*p, _meeting(*p))
        case "gauss2mf":
            places = (p[1], p[3])
        case "gbellmf":
            places = (p[2] - p[0], p[2], p[2] + p[0])
        case "gaussmf" | "sigmf":
            places = (p[1],)
        case _:
            places = (p[1], p[3], *_turns(one)) if one.kind in ("dsigmf", "psigmf") else ()
    if not places or (shift == 0 and widths == 0):
        return places
    low, high = core(one)
    if widths > 0:
        nearest = [(x, min(max(x, low), high)) for x in places]
        factors = (1.0 - widths, 1.0, 1.0 + widths)
        places = tuple(q + factor * (x - q) for x, q in nearest for factor in factors)
    crossing = (_crossing(one),) if shift > 0 and np.isfinite([low, high]).all() else ()
    return (*crossing, *(x + s for x in places for s in (-shift, 0.0, shift)))


def _meeting(a: float, b: float, c: float, d: float) -> float:
    """Where the flanks of a trapezoid meet whose tops cross."""
    width = (b - a) + (d - c)
    return (a * (d - c) + d * (b - a)) / width if width > 0 else a


BISECTIONS = 80


@lru_cache(maxsize=1024)
def _crossing(one: FuzzySet) -> float:
    """Where the memberships of the set moved left and right as far as it may be are equal."""
    (low, high), shift, factor = core(one), one.footprint.mean, 1.0 - one.footprint.spread
    if one.kind in ("gaussmf", "gbellmf"):
        return low

    def difference(x: float) -> float:
        left, right = membership(one, _stretched(one, x + np.array([-shift, shift]), factor))
        return float(left - right)

    return root(difference, low - shift, high + shift)


@lru_cache(maxsize=1024)
def _turns(one: FuzzySet) -> Parameters:
    """Where a product of two sigmoids is largest, and a difference largest or 0."""
    (c_1, c_2), (a_1, a_2) = one.shape[1::2], one.shape[::2]
    if a_1 == 0 or a_2 == 0:  # what is left rises or falls throughout, and passes 1/2 at its centre
        return ()
    reach = abs(c_1 - c_2) + 750.0 / min(abs(a_1), abs(a_2))  # exp(-750) is 0
    if one.kind == "psigmf":
        # The slope of its logarithm falls throughout, from above 0 to below it if it has a peak.
        centres, slopes = np.array([c_1, c_2]), np.array([a_1, a_2])
        peak = root(
            lambda x: -float(slopes @ np.exp(-np.logaddexp(0.0, slopes * (x - centres)))),
            min(c_1, c_2) - reach,
            max(c_1, c_2) + reach,
        )
        return (peak,)
    zero = ((a_1 * c_1 - a_2 * c_2) / (a_1 - a_2),) if a_1 != a_2 else ()
    if a_1 * a_2 < 0:
        return zero
    # At the centre of the steeper one that one is steeper, and far off, or never, the other.
    (steep, centre), (flat, other) = sorted([(a_1, c_1), (a_2, c_2)], key=lambda s: -abs(s[0]))

    def steeper(x: float) -> float:
        ratio = _log_slope(steep * (x - centre)) - _log_slope(flat * (x - other))
        return ratio + log(steep / flat)

    left = root(steeper, centre - reach, centre)
    right = root(lambda x: -steeper(x), centre, centre + reach)
    return (*zero, left, right)


def _log_slope(z: float) -> float:
    """Logarithm of the slope of 1 / (1 + exp(-z))."""
    return -abs(z) - 2.0 * log1p(exp(-abs(z)))


def root(function: Callable[[float], float], left: float, right: float) -> float:
    """Zero of an increasing function, by bisection."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (left + right)
        left, right = (left, middle) if function(middle) > 0 else (middle, right)
    return 0.5 * (left + right)


def membership(one: FuzzySet, x: Array) -> Array:
    """Type-1 membership of x, any shape, with the set in its principal form."""
    if one.kind in FUNCTION_KINDS:
        raise ValueError(f"set {one.name!r}: a {one.kind} consequent has no membership")
    return np.asarray(FORMS[one.kind].function(x, one.shape))


def upper_membership(one: FuzzySet, x: Array) -> Array:
    """Largest membership of x over the footprint."""
    shift, widths = one.footprint.mean, one.footprint.spread
    if shift == 0 and widths == 0:
        return membership(one, x)
    # Moving the set by s is moving x by -s: the best x within reach is the nearest to the core.
    nearest = np.clip(x, *core(one))
    distance = nearest - x
    step = np.clip(distance, -shift, shift)
    # A sum would round to either side of the core's end, which may be a vertical flank.
    moved = np.where(step == distance, nearest, x + step)
    return membership(one, _stretched(one, moved, 1.0 + widths))


def lower_membership(one: FuzzySet, x: Array) -> Array:
    """Smallest membership of x over the footprint."""
    shift, widths = one.footprint.mean, one.footprint.spread
    # A function that rises and then falls is smallest at an end of any interval.
    moved = (membership(one, _stretched(one, x + s, 1.0 - widths)) for s in {-shift, shift})
    least = np.minimum.reduce(list(moved))
    scale, lag = one.footprint.scale, one.footprint.lag
    return np.asarray(scale * np.maximum(least - lag, 0.0) / (1.0 - lag))


def _stretched(one: FuzzySet, x: Array, factor: float) -> Array:
    """Where the principal form is what one with flanks `factor` times as wide is at x."""
    if factor == 1.0:
        return x
    nearest = np.clip(x, *core(one))
    return nearest + (x - nearest) / factor
