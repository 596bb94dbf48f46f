"""The simulated rangefinder, as a source of blocks or behind a pseudo-terminal; every run is reproducible."""
