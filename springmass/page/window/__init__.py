"""The window: dropped recordings become cards, which ask, show results and give files; a process of its own opens each.

In: files from a browser and what is typed there. Out: cards as JSON, and the files to take away. ``child`` reads and
analyses in a process, with what ``contents`` shows and the ``bench`` as a form; ``processes`` limits it; ``cards``
keeps them on disk; ``recording`` runs the recorder, ``shortcut`` makes the icon; :mod:`springmass.page.web.window`
serves them. Only ``child`` opens a recording, so a hostile one cannot harm the window.
"""
