"""A course: hundreds or thousands of runs to one table, resumable, on this machine or on a cluster.

In: recordings, a ``runs.csv`` that states what is known of each, options. Out: a folder with one row a run (CSV,
Parquet), a page, and reports of the runs that need a look. Free to change: how work is cut and handed out; a row
depends on its run alone, so that every way gives the same bytes. Only the log has times of day.
"""
