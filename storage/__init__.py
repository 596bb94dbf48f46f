"""Files on disk: wire logs during a recording, run files afterwards. A run file is never half written.

In: blocks, raw bytes as received, descriptions of sources. Out: files, and their content when they are read again, or
a one-line error of :mod:`storage.errors`. `run_file` and `wire_log` each implement a format that a page in
docs/reference describes. `recovery` builds run files from wire logs. :mod:`storage.atomic` writes any file whole or
not at all. Importing this package loads no other module.
"""
