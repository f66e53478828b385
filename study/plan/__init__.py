"""From what a scene requires to the least that has to be modelled, and why."""
