"""Tables that scripts measure and write to the pages of their cases."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

BEGIN, END = "<!-- measured tables -->", "<!-- end of measured tables -->"


def write_tables(page: Path, tables: Iterable[Iterable[str]]) -> None:
    """Replace the text between the marks of a page by tables, each given by its lines."""
    before, rest = page.read_text(encoding="utf-8").split(BEGIN)
    _, after = rest.split(END)
    text = "\n\n".join("\n".join(lines) for lines in tables)
    page.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")
