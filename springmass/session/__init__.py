"""A recording session at the bench.

In: open ports, each with its sensor. Out: a wire log with every byte, the progress of the run while it is recorded, and
rest positions and calibrations measured before it.
To change: what is shown (``progress``), when a run starts (``trigger``). In ``reads`` bytes are recorded before
anything is made of them; that order stays.
"""
