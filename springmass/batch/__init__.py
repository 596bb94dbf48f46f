"""Analyse a course of hundreds or thousands of runs into one table, resumably, on this machine or on a cluster.

In: recordings, a ``runs.csv`` with the known values of each run, options. Out: a folder with a table of one row per run
(CSV, Parquet), a page, and reports of the runs that need inspection. Free to change: how work is divided and
distributed. A row depends only on its run, so every division gives the same bytes. Only the log contains times of day.
"""
