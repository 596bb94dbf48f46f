"""Every chart as data: charts.js draws it in a browser, matplotlib in a file and in a notebook.

In: analyses, comparisons and simulations. Out: a ``Chart`` (``chart``), which knows nothing about how it is drawn. The
functions of ``run``, ``several``, ``simulation`` and ``drag_map`` make one each; ``CHARTS`` in ``run`` names those of a
run. ``draw`` draws any of them with matplotlib, and only when asked.
"""
