"""The bench page: what a recording does, seen in a browser while it happens, and an old run looked at the same way.

In: a wire log that grows, or a run that was loaded. Out: a page on the loopback interface, and the documented messages
behind it. It is a viewer in a process of its own: it reads what the log has taken and can neither delay nor end a
recording. Free to change: the page under ``static``; messages are versioned (docs/reference/page-messages.md).
"""
