"""What a terminal is shown: tables, colour, progress, and what of it a pipe or a plain terminal gets instead.

In: numbers and findings. Out: text. Where standard output is no terminal it is plain ASCII in SI units, line by line as
the reference has it; rich is imported on a terminal only. Free to change: how a terminal looks; what a pipe gets stays.
"""
