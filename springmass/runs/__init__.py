"""A run's way through the program, without a line of printing.

In: paths of recordings, run files and wire logs, scenes, options. Out: what was loaded, analysed, compared or
simulated, and its JSON, which is one schema for all commands. Free to change: what becomes of an input on its way to
a Track; the JSON may gain keys, and docs/reference/json.md with it, but none may change its meaning.
"""
