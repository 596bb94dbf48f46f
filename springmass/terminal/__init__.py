"""Input and output at a terminal: tables, progress, keys, and the plain output for a pipe.

If a stream is not a terminal, the text is plain ASCII in SI units, exactly as described in the reference.
"""
