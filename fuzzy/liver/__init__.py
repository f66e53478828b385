"""The paper's fuzzy system: liver stiffness from elastography readings of five aetiologies."""
