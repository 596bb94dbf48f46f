"""Report: one run or several as a page to read, figures to print and tables to paste."""

from springmass.report.figures import draw, render
from springmass.report.html import ReportRun, render_html
from springmass.report.tables import TableRow, results_csv, table_rows, table_tex, text_table
from springmass.report.write import write_report

__all__ = [
    "ReportRun",
    "TableRow",
    "draw",
    "render",
    "render_html",
    "results_csv",
    "table_rows",
    "table_tex",
    "text_table",
    "write_report",
]
