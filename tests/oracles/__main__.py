"""Make the kept answers again: `python -m tests.oracles`, where the programs are installed."""

from tests.oracles import calculix, matrices
from tests.oracles.cases import CASES, DYNAMIC, build, keep, ramp


def main() -> None:
    """Run every program on every case; the files go to tests/data/oracles."""
    for name in CASES:
        found = build(name)
        frames = {"rest": calculix.at_rest(found.problem)}
        if name == DYNAMIC:
            frames |= dict(
                zip(("loaded", "held"), calculix.moving(found.problem, ramp()), strict=True)
            )
        keep(f"calculix-{name}", f"CalculiX {calculix.version()}", found.problem, frames)
        for program in matrices.PROGRAMS:
            answer = matrices.assemble(program, found, matrices.rule_for(program, found))
            keep(
                f"{program}-{name}",
                f"{program} {answer.version}",
                found.problem,
                answer.frames(found.body),
            )


if __name__ == "__main__":
    main()
