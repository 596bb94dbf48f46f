"""Run a recording session at the bench.

In: open ports, each with its sensor. Out: a wire log with every byte, the progress during the recording, and rest
positions and calibrations measured before it.
Free to change: what is shown (``display``), and when a run starts (``trigger``). In ``reads``, bytes are recorded
before they are processed; this order must not change.
"""
