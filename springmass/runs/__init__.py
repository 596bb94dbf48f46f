"""Runs: a recording with its analysis, which every command, page, report, course and script shows; and lists of tasks.

In: paths or arrays, scenes, options. Out: analysed runs, or why there is none.
"""
