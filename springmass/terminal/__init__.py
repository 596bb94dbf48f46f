"""Input and output at a terminal: arguments, tables, colour, progress, and the plain output for a pipe.

In: numbers and findings. Out: options and text. If standard output is not a terminal, the text is plain ASCII in SI
units, exactly as described in the reference; rich is imported only for a terminal. Free to change: the appearance on a
terminal. The output to a pipe must not change.
"""
