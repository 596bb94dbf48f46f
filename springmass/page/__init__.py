"""What a browser shows: the window with all recordings (``window``), and the bench page of one, as it goes on or was.

In: a growing wire log, or a loaded run. Out: a page on the loopback interface, and the documented messages behind it.
The page is a viewer in a separate process: it reads the log and can neither delay nor end a recording. Free to change:
the page under ``static``; messages are versioned (docs/reference/page-messages.md). ``web`` has the servers of both.
"""
