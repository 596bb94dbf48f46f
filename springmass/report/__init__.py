"""Report of one or several runs: a page to read, figures to print, and tables to paste.

In: analyses from the pipeline, and facts about their inputs. Out: report.html, figures, table.tex and CSV in one folder
(`write.write_report`). Free to change: each figure is a maker in `figures` and a line in its MAKERS; the page is
`templates/report.html.j2`. Table 1 lists the quantities of `pipeline.registry.quantities`. No results are calculated
here.
"""
