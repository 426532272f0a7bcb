"""Writes the notebook with its output and pictures into docs/python.md: `python tests/python/page.py`, from anywhere."""

from __future__ import annotations

import base64
import tempfile
from pathlib import Path

import nbclient
import nbformat

ROOT = Path(__file__).resolve().parents[2]
PAGE, FIGURES = ROOT / "docs/python.md", ROOT / "docs/python"
START, END = "<!-- notebook: written by tests/python/page.py -->\n", "<!-- end of the notebook -->\n"


def text_of(output: nbformat.NotebookNode) -> str:
    """What a terminal would show."""
    if output.output_type == "stream":
        return str(output.text)
    return str(output.get("data", {}).get("text/plain", "")) + "\n"


def main() -> None:
    """Run every cell, then put code, text and pictures one after the other."""
    book = nbformat.read(Path(__file__).with_name("notebook.ipynb"), as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "data").symlink_to(ROOT / "data")
        nbclient.NotebookClient(book, timeout=600, resources={"metadata": {"path": folder}}).execute()
    parts: list[str] = []
    pictures = 0
    for cell in book.cells:
        if cell.cell_type == "markdown":
            # the page has a title of its own
            parts.append("\n".join(line for line in cell.source.splitlines() if not line.startswith("# ")).strip())
            continue
        parts.append(f"```python\n{cell.source}\n```")
        # what goes to stderr is no result
        shown = [one for one in cell.outputs if one.get("name") != "stderr"]
        plain = "".join(text_of(one) for one in shown if "image/png" not in one.get("data", {})).rstrip()
        if plain and not plain.startswith("<Axes"):
            parts.append(f"```text\n{plain}\n```")
        for one in shown:
            if "image/png" in one.get("data", {}):
                pictures += 1
                name = f"{pictures}.png"
                (FIGURES / name).write_bytes(base64.b64decode(one.data["image/png"]))
                words = one.data.get("text/plain", "figure").splitlines()[0]
                parts.append(f"![{'figure of the cell above' if words.startswith('<') else words}](python/{name})")
    page = PAGE.read_text(encoding="utf-8")
    head, rest = page.split(START)
    tail = rest.split(END)[1]
    PAGE.write_text(head + START + "\n" + "\n\n".join(filter(None, parts)) + "\n\n" + END + tail, encoding="utf-8")


if __name__ == "__main__":
    main()
