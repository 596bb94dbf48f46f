"""Report of one or several runs: a page to read, figures to print, and tables to paste.

In: runs. Out: report.html, figures, table.tex and CSV in one folder (`write.write_report`). The page is
`templates/report.html.j2` with the charts of `springmass.charts`. No results are calculated here.
"""
