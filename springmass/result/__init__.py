"""The result of a run in every form: Table 1, JSON, CSV, frames, summaries, budgets, and what it is worth.

In: a loaded recording and its analysis. Out: rows, mappings, frames and text; no file is written here. The JSON has one
schema for all commands: it may gain keys, together with docs/reference/json.md, but no key may change its meaning. The
room is not called ``results``, because ``springmass.results`` is a function of the library.
"""
