"""Pages that are made for each build: notebooks with cards that lead to them, and commands."""

from __future__ import annotations

import base64
import html
import io
import json
import re
from pathlib import Path

from cyclopts.docs.markdown import generate_markdown_docs
from PIL import Image

from geodesic_ocp.cli.main import new_app

_WIDTH = 600  # of a picture on a card [pixels]
_SHORT = 80  # letters of a sentence that is not enough for a card
_OPTION = re.compile(r"(?<![`\w-])--[a-z][a-z-]*(=[-\w]+)?")  # in sentences
_FRAME = re.compile(r'<iframe srcdoc="(.*?)"', re.DOTALL)


def write_notebooks(source: Path, folder: Path, viewers: Path) -> None:
    """Copy notebooks; write cards.md, which shows them in the order of the folder's index, and the
    pages of the viewer in them.
    """
    cards = ["```{container} cards"]
    for name in re.findall(r"^(\w+)$", (folder / "index.md").read_text(), re.MULTILINE):
        text = (source / f"{name}.ipynb").read_text(encoding="utf-8")
        (folder / f"{name}.ipynb").write_text(text.replace("](../docs/", "](../"), "utf-8")
        cells = json.loads(text)["cells"]
        outputs = [each.get("data", {}) for cell in cells for each in cell.get("outputs", ())]
        pictures = [each["image/png"] for each in outputs if "image/png" in each]
        picture = Image.open(io.BytesIO(base64.b64decode(max(pictures, key=len))))
        width, height = picture.size
        picture = picture.crop((0, 0, width, min(height, width * 9 // 16)))
        picture.thumbnail((_WIDTH, _WIDTH))
        picture.save(folder / f"{name}.png", optimize=True)
        title, first = _opening("".join(cells[0]["source"]))
        cards += [f"- [![]({name}.png)]({name}.ipynb)", f"\n  **[{title}]({name}.ipynb)**"]
        cards += [f"\n  {first}\n"]
        if frames := _FRAME.findall(
            "".join("".join(each.get("text/html", "")) for each in outputs)
        ):
            (viewers / f"{name}.html").write_text(html.unescape(frames[0]), encoding="utf-8")
    (folder / "cards.md").write_text("\n".join([*cards, "```", ""]), encoding="utf-8")


def _opening(text: str) -> tuple[str, str]:
    """The title and the first sentences, without links."""
    title, paragraph, *_ = text.split("\n\n")
    sentences = re.split(r"(?<=[.?])\s", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", paragraph))
    first = sentences[0] if len(sentences[0]) > _SHORT else " ".join(sentences[:2])
    return title.lstrip("# "), first


def write_commands(folder: Path) -> None:
    """Write a page for each command of geodesic-ocp, and index.md with one line for each."""
    app = new_app()
    names = [name for name in app if not name.startswith("-")]
    rows = ["| command | |", "| --- | --- |"]
    for name in names:
        usage, fence, text = generate_markdown_docs(app, commands_filter=[name]).rpartition("```")
        page = f"# {name}\n\n{usage}{fence}" + _OPTION.sub(r"`\g<0>`", text)
        (folder / f"{name}.md").write_text(page, encoding="utf-8")
        rows.append(f"| [{name}]({name}.md) | {app[name].help} |")
    toc = ["```{toctree}", ":hidden:", "", *names, "```", ""]
    index = ["# Command line", "", str(app.help), "", *rows, "", str(app.help_epilogue), "", *toc]
    (folder / "index.md").write_text("\n".join(index), encoding="utf-8")
