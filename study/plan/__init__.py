"""The least that has to be modelled to meet a scene's requirements, and why."""
