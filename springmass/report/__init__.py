"""Report: one run or several as a page to read, figures to print and tables to paste.

In: analyses as the pipeline gives them, and what is known of their inputs. Out: report.html, figures, table.tex, CSV,
all in one folder (`write.write_report`). Free to change: a figure is a maker in `figures` and a line in its MAKERS, a
row of Table 1 a line in `tables`, the page `templates/report.html.j2`; no number is calculated here.
"""
