"""What is typed at a terminal and what it is shown: arguments, tables, colour, progress, and what a pipe gets instead.

In: numbers and findings. Out: options, text. Where standard output is no terminal it is plain ASCII in SI units, line
by line as the reference has it; rich is imported on a terminal only. Free to change: how a terminal looks; what a pipe
gets stays.
"""
