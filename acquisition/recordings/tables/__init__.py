"""Text and binary tables: their headings, channels and numbers.

In: the bytes of a file and the layout of its tables. Out: numbers, and which cells and rows could not be read; no
samples yet. ``regular`` reads regular lines with numpy, and ``table`` reads all others. ``contents`` lists the
words for time.
"""
