"""Models beside measurements on bodies of known shape: silicone cylinders, a beam and a cube."""
