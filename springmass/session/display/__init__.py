"""Show a recording while it runs, without being able to delay or end it.

In: blocks of samples and the recorder's status. Out: about once a second, a Progress for the terminal or the page.
Free to change: what is shown. Failures in this package are counted and written into the run; the recording continues.
"""
