"""Bodies to balance other than the equations: the same cart-pole in simulators."""
