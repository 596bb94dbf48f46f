"""One module a command: ``run(arguments, options) -> exit code``.

In: arguments and options, as ``springmass.command_line`` and ``springmass.options`` declare them. Out: lines on stdout,
messages on stderr, files, an exit code of `springmass.errors`. Free to change: what one command prints. A new command
is a module here, a function in ``springmass.command_line`` and perhaps a dataclass of options.
"""
