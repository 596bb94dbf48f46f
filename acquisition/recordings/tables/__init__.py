"""Text and binary tables: headings and channels of what a family found, and the numbers in their columns.

In: a file's bytes and what stands where in them. Out: numbers, and which cells and rows are none; no sample yet.
``regular`` reads lines alike with numpy, ``table`` the rest; a newcomer may add words for time in
``contents``, traps in ``sheet``.
"""
