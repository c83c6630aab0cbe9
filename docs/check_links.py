"""Fail if the built site links to a page, a file or an anchor that it does not have, or shows a
table as the text that it was written in.

python docs/check_links.py docs/_build/html
"""

from __future__ import annotations

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class _Page(HTMLParser):
    """The links and the anchors of one page."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(file.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if value and name in ("href", "src"):
                self.links.append(value)
            elif value and name == "id":
                self.anchors.add(value)


def dead_links(site: Path) -> list[str]:
    """Every link inside the site whose target is missing."""
    pages = {file.resolve(): _Page(file) for file in site.rglob("*.html")}
    dead = []
    for file, page in pages.items():
        for link in page.links:
            url = urlsplit(link)
            if url.scheme or url.netloc:
                continue
            target = (file.parent / unquote(url.path)).resolve() if url.path else file
            anchors = pages[target].anchors if target in pages else None
            if not target.exists() or (
                url.fragment and anchors is not None and unquote(url.fragment) not in anchors
            ):
                dead.append(f"{file.relative_to(site.resolve())}: {link}")
    return dead


_PIPES = re.compile(r"<p>\|[^<]*\|\n\|")  # two rows
_SCRIPTS = re.compile(r"<(script|iframe|pre)\b.*?</\1>|srcdoc=\"[^\"]*\"", re.DOTALL)


def raw_tables(site: Path) -> list[str]:
    """Every page with the pipes of a table in its text."""
    texts = {file: file.read_text(encoding="utf-8") for file in site.rglob("*.html")}
    return [
        f"{file.relative_to(site)}: {found.group()[:60]!r} is no table"
        for file, text in texts.items()
        if (found := _PIPES.search(_SCRIPTS.sub("", text)))
    ]


if __name__ == "__main__":
    found = dead_links(Path(sys.argv[1])) + raw_tables(Path(sys.argv[1]))
    print("\n".join(found) or "no dead links, no raw tables")
    sys.exit(bool(found))
