"""Many runs: in this process, on a local cluster or on a distant one, each kept as it finishes."""
