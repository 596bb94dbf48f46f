"""Analyse a course of hundreds or thousands of runs into one table, resumably, on this machine or on a cluster.

In: recordings, a ``runs.csv`` with the known values of each run, options. Out: a folder with ``course.db``, a table of
one row per run, a page, and reports of the runs that need inspection. A row depends only on its run and not on who
analysed it. Only the process that runs the course opens ``course.db``; everything else reads ``results.csv``.
"""
