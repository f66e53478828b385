"""The finite-element reference: exact solutions, and how often its stated errors hold."""

from collections.abc import Iterator

from docs.figures.formats import rounded_up, table
from docs.figures.tables import Line, measured, ratios

PROBLEMS = (  # words, problem, quantity with the element, for quadratic and mixed elements
    ("thick sphere, nu 0.3", "thick sphere", "displacement, largest error, {}, nu 0.3"),
    ("thick sphere, nu 0.49", "thick sphere", "displacement, largest error, {}, nu 0.49"),
    ("thick sphere, nu 0.49999", "thick sphere", "displacement, largest error, {}, nu 0.49999"),
    ("bent bar, deflection", "bent bar", "deflection of the end [m], {}, nu {nu}"),
    ("tool on a half space, mean depth", "half space", "mean depth [m], {}, nu {other}"),
    ("torsion of a ball", "torsion in an eighth", "mean of two omega R / c_s, {}, nu {other}"),
)
ORDERS = {
    "order-p2": ("manufactured, quadratic", "displacement, L2, p2, nu 0.3"),
    "order-mixed": ("manufactured, mixed", "displacement, L2, taylor-hood, nu 0.4999"),
}
CERTIFICATE = "128"
"""Of a scene, unless it says otherwise."""


def verification() -> Iterator[tuple[str, str]]:
    """The reference on problems with exact solutions."""
    lines = {(line["problem"], line["quantity"]): line for line in measured("verification")}
    yield "verification-findings", str(len(lines))
    rows = []
    for words, problem, quantity in PROBLEMS:
        p2 = lines[problem, quantity.format("p2", nu="0.3", other="0.45")]
        mixed = lines[problem, quantity.format("taylor-hood", nu="0.4999", other="0.4999")]
        rows.append([words, *(f"{100 * float(one['error']):.2g} %" for one in (p2, mixed))])
    yield "verification", table(("problem", "quadratic tetrahedra", "Taylor-Hood"), rows)
    for name, key in ORDERS.items():
        yield name, f"{float(lines[key]['order']):.2f}"


def error_bar() -> Iterator[tuple[str, str]]:
    """How often the reference's stated error holds."""
    lines = measured("error_bar")
    yield "errors-scenes", str(len({line["scene"] for line in lines}))
    yield from _held("errors", lines, ".1f")


def error_bar_livers() -> Iterator[tuple[str, str]]:
    """How often the error stated on graded meshes holds."""
    lines = measured("error_bar_livers")
    yield "liver-errors-shapes", str(len({line["shape"] for line in lines}))
    yield from _held("liver-errors", lines, ".2f")


def _held(name: str, lines: list[Line], form: str) -> Iterator[tuple[str, str]]:
    """Numbers of stated errors and of those that are at least the true one, and the worst ratio."""
    factors = ratios(lines, "true", over="stated")
    yield f"{name}-stated", str(len(lines))
    yield f"{name}-held", str(sum(factor <= 1.0 for factor in factors))
    yield f"{name}-worst", f"{max(factors):{form}}"


def certified() -> Iterator[tuple[str, str]]:
    """The error of a superposition and its bound, by damping, load and vectors."""
    lines = [line for line in measured("certified") if line["certificate"] == CERTIFICATE]
    rows: dict[tuple[str, ...], list[str]] = {}
    for line in lines:
        damping = f"{float(line['mass_per_s']):.3g} /s, {1e3 * float(line['stiffness_s']):g} ms"
        cell = f"{rounded_up(line['error'], 100)} / {rounded_up(line['bound'], 100)} %"
        rows.setdefault((line["damping"], damping, line["load"]), []).append(cell)
    vectors = dict.fromkeys(line["vectors"] for line in lines)
    numbers = (f"{number} vectors, error / bound" for number in vectors)
    head = ("damping", "alpha, beta", "load", *numbers)
    yield "certified", table(head, [[*key, *cells] for key, cells in rows.items()])
