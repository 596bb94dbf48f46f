"""The bench page: a recording in a browser while it goes on, and an old run on the same page.

In: a wire log that grows, or a run that was loaded. Out: a page on the loopback interface, and the documented messages
behind it. It is a viewer in a separate process: it reads the log and can neither delay nor end a
recording. Free to change: the page under ``static``; messages are versioned (docs/reference/page-messages.md).
"""
