"""One simulated robot: its memory, every quantity of a tick, the simulation itself."""
