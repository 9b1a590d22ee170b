"""Writes the index of the cases, README.md, from the heads of their pages.

python -m validation
"""

from __future__ import annotations

import re
from pathlib import Path

FOLDER = Path(__file__).parent
PAGE = FOLDER / "README.md"
# The list below the title of a page: these entries, of which the figure may be missing.
ENTRIES = ("Compared with", "Bar", "Commit", "Command", "Figure")

TOP = """\
# Validation

How accurate the results are: closed forms, other codes, experiments, convergence, and the ends of the range
of input. One folder for each case: its text (`README.md`), its tests (`test_*.py`), the script that measures
and draws (run by `python -m validation.CASE`), reference data and figures. The tests of cases that only the
core computes are in `crates/sandboil-solver/tests/validation`. Units kN, m, s, Mg.

Every figure is printed by the command of its case, or is the bound that its test asserts. The commit is the
one at which the figures were measured, on two cores of a shared x86-64 server. All commands are run from the
top folder of the repository, in the environment that `make test` creates.

`pytest validation` runs the tests, `pytest -m slow validation` the long ones. `python -m validation` writes
this page from the pages of the cases.

| case | compared with | bar | figure | commit | command |
|---|---|---|---|---|---|
"""


def entries(page: Path) -> dict[str, str]:
    """Title and list below it of a case's page; ValueError if an entry is missing or unknown."""
    title, _, rest = page.read_text(encoding="utf-8").partition("\n")
    head = dict(re.findall(r"^- ([A-Z][a-z ]+): (.+)$", rest.strip().partition("\n\n")[0], re.MULTILINE))
    if tuple(head) not in (ENTRIES, ENTRIES[:-1]):
        raise ValueError(f"{page}: the list below the title must have the entries {ENTRIES}")
    return {"Title": title.removeprefix("# "), "Figure": ""} | head


def row(page: Path) -> str:
    """A case's row in the table."""
    case, head = page.parent.name, entries(page)
    figure = f"[{head['Figure']}]({case}/{head['Figure']})" if head["Figure"] else ""
    cells = [f"[{head['Title']}]({case}/README.md)", head["Compared with"], head["Bar"], figure]
    return f"| {' | '.join([*cells, head['Commit'], head['Command']])} |\n"


def index() -> str:
    """The text of the index page."""
    return TOP + "".join(map(row, sorted(FOLDER.glob("*/README.md"))))


if __name__ == "__main__":
    PAGE.write_text(index(), encoding="utf-8")
