"""Workbooks, xlsx and xls: ``sheets`` checks the stated sizes and starts ``child``, a process that reads the cells.

In: the bytes of an xlsx or xls. Out: its sheets as text for the readers of text. ``child`` prints the cells.
"""

from acquisition.recordings.families.workbook.sheets import FORMAT

__all__ = ["FORMAT"]
