"""An icon that opens the window, for those who do not type; a file manager can open recordings with it too."""

from __future__ import annotations

import re
import shlex
import sys
from pathlib import Path

from platformdirs import user_data_path, user_desktop_path

from springmass.errors import ProgramError

ICON = Path(__file__).parents[1] / "static" / "icon.svg"
OPENED = "text/csv;text/plain;text/tab-separated-values;application/zip;application/x-hdf;application/vnd.ms-excel;"
_DESKTOP = """[Desktop Entry]
Type=Application
Name=springmass
Comment=Period, spring constant and damping of a recorded oscillation
Exec={python} -m springmass page %F
Icon={icon}
Terminal=false
Categories=Science;Education;
MimeType={opened}
"""


def make_shortcut() -> str:
    """Write the icon as this system has it, and return where it is."""
    desktop = user_desktop_path()
    if sys.platform == "win32":
        python = Path(sys.executable).with_name("pythonw.exe")
        name, text = "springmass.bat", f'@start "" "{python}" -m springmass page %*\r\n'
    elif sys.platform == "darwin":
        name, text = "springmass.command", f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m springmass page "$@"\n'
    else:
        name = "springmass.desktop"
        python = '"{}"'.format(re.sub(r'(["`$\\])', r"\\\\\1", sys.executable).replace("%", "%%"))
        text = _DESKTOP.format(python=python, icon=ICON, opened=OPENED)
    folders = [desktop] if desktop.is_dir() else []
    if name.endswith(".desktop"):  # the menu, and "open with" of file managers
        folders.append(user_data_path() / "applications")
    made = []
    for folder in folders or [Path.home()]:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, "utf-8", newline="")
            (folder / name).chmod(0o755)
        except OSError as error:
            raise ProgramError(f"{folder / name}: cannot be written ({error.strerror})", "check the folder") from error
        made.append(f"{folder / name}: opens the window; recordings can be opened with it")
    return "\n".join(made)
