"""Run a recording session at the bench: from open ports to a wire log with every byte, and the progress meanwhile.

In ``reads``, bytes are recorded before they are processed; this order must not change.
"""
