"""Workbooks: ``sheets`` reads them; ``biff`` and ``compound`` write an xls anew, bounded, before it is handed over.

In: the bytes of an xlsx or xls. Out: what its sheets hold. A newcomer who wants more of a cell than its value begins in
``sheets``; what of an xls is kept at all stands in ``biff``.
"""

from acquisition.recordings.families.workbook.sheets import FORMAT

__all__ = ["FORMAT"]
