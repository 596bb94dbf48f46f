"""What stays on the disk: wire logs while recording, run files afterwards, each never half there.

In: blocks, raw bytes as they came, descriptions. Out: files, and from them the same again or a one-line error of
:mod:`storage.errors`. Free to change: the rooms `run_file` and `wire_log`, each behind its format's page in
docs/reference, and `recovery`, which makes the one of the other; :mod:`storage.atomic` writes any file whole or not at
all. Importing this package costs nothing.
"""
