"""Many runs: in this process, on a local cluster or a remote one, each stored as it finishes."""
