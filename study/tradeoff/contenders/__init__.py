"""One file per contender, each named in `study.tradeoff.lineup`."""
