"""Load, analyse, compare and simulate runs without printing anything.

In: paths of recordings, run files and wire logs, scenes, options. Out: loaded, analysed, compared or simulated runs,
and their JSON, which has one schema for all commands. Free to change: the processing of an input into a Track. The
JSON may gain keys, together with docs/reference/json.md, but no key may change its meaning.
"""
