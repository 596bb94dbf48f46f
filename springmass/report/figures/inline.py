"""A figure's file as an element of a page, where names are its own and nothing speaks for the whole page."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["inline_svg"]


def inline_svg(svg: bytes, prefix: str) -> Markup:
    """Return an SVG file as an element for a page: names of its own.

    Parameters
    ----------
    svg : bytes
        As :func:`springmass.report.figures.render` makes it.
    prefix : str
        Of every id, so that figures on one page do not take each other's clip paths.
    """
    from markupsafe import Markup

    text = svg.decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:xlink)?="[^"]*"| version="1.1"', "", text).replace("xlink:href", "href")
    used = dict.fromkeys(re.findall(r'(?:href="|url\()#([^")]+)', text))
    short = {name: f"{prefix}{i}" for i, name in enumerate(used)}

    def renamed(found: re.Match[str]) -> str:
        # Groups are named as well, but nobody calls them.
        return f' id="{short[found[1]]}"' if found[1] in short else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    text = re.sub(r'(href="|url\()#([^")]+)', lambda found: f"{found[1]}#{short[found[2]]}", text)
    # A style for "*" would reach the whole page from here.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.DOTALL)
    text = re.sub(r"<defs>\s*</defs>", "", text)
    text = _shared_styles(text)
    return Markup(re.sub(r">\s+<", "><", text).strip())


def _shared_styles(text: str) -> str:
    """Move the style of a run of equal markers to one group around them."""
    one = r'<use href="[^"]*" x="[^"]*" y="[^"]*" style="[^"]*" ?/>'

    def grouped(found: re.Match[str]) -> str:
        styles = set(re.findall(r'style="([^"]*)"', found[0]))
        if len(styles) != 1:
            return found[0]
        return f'<g style="{styles.pop()}">' + re.sub(r' style="[^"]*"', "", found[0]) + "</g>"

    return re.sub(rf"{one}(?:\s*{one})+", grouped, text)
