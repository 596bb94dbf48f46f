"""Every chart as data: charts.js draws it in a browser, matplotlib in a file and in a notebook.

In: analyses and comparisons. Out: a ``Chart`` (``chart``), which knows nothing about how it is drawn. The functions of
``run`` and ``several`` make one each. ``draw`` draws any of them with matplotlib, and only when asked. ``looks`` has
the colours for both; ``static`` has charts.js, uPlot and the style, which page, reports and courses share.
"""
