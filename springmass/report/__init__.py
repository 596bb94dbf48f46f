"""Report: one run or several as a page to read, figures to print and tables to paste.

In: analyses as the pipeline gives them, and what is known of their inputs. Out: report.html, figures, table.tex, CSV,
all in one folder (`write.write_report`). Free to change: a figure is a maker in `figures` and a line in its MAKERS, a
row of Table 1 a line in `tables`, the page `templates/report.html.j2`; no number is calculated here.
"""

from springmass.report.budgets import budget_csv, budget_text, budgets_of
from springmass.report.figures import draw, render
from springmass.report.html import render_html
from springmass.report.latex import budget_tex, table_tex
from springmass.report.tables import TableRow, results_csv, table_rows, text_table
from springmass.report.write import write_report

__all__ = [
    "TableRow",
    "budget_csv",
    "budget_tex",
    "budget_text",
    "budgets_of",
    "draw",
    "render",
    "render_html",
    "results_csv",
    "table_rows",
    "table_tex",
    "text_table",
    "write_report",
]
