"""Links, files, items of code, tests and modules that the documents name exist; the index is up to date."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from validation.__main__ import PAGE as INDEX
from validation.__main__ import index

ROOT = Path(__file__).parents[1]
FOLDERS = ("crates", "python", "tests", "validation", "docs", "examples")
PAGES = sorted(
    [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *ROOT.glob("docs/**/*.md"),
        *ROOT.glob("validation/**/*.md"),
    ]
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
# A path from the top folder, in text or in a command; `*` stands for any name.
PATH = re.compile(rf"(?<![\w/.<-])(?:{'|'.join(FOLDERS)})/[\w./*-]*\w/?")
# A file by the end of its path, in backticks.
FILE = re.compile(r"`([\w./-]+\.(?:rs|py|pyi|toml|md))`")
# An identifier so long that it names a test or a function.
LONG_NAME = re.compile(r"`([a-z]+(?:_[a-z0-9]+){3,})`")
MODULE = re.compile(r"python -m (validation[\w.]*)")
CONTRIBUTING = ROOT / "CONTRIBUTING.md"
EQUATIONS = ROOT / "docs" / "theory" / "formulation.md"


def by_place(page: Path) -> str:
    return str(page.relative_to(ROOT))


@cache
def sources() -> dict[str, str]:
    """The text of every source file and page by its path from the top folder."""
    endings = (".rs", ".py", ".pyi", ".toml", ".md")
    files = [file for folder in FOLDERS for file in (ROOT / folder).rglob("*") if file.suffix in endings]
    files += [file for file in ROOT.iterdir() if file.suffix in endings]
    return {by_place(file): file.read_text(encoding="utf-8") for file in files}


def ending_with(name: str) -> list[str]:
    """The sources whose path ends with the name."""
    return [path for path in sources() if path == name or path.endswith(f"/{name}")]


@cache
def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=by_place)
def test_links_resolve(page: Path) -> None:
    for link in LINK.findall(page.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://")):
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target.resolve()), link


@pytest.mark.parametrize("page", PAGES, ids=by_place)
def test_named_files_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for path in PATH.findall(text):
        assert any(ROOT.glob(path)), path
    for name in FILE.findall(text):
        assert ending_with(name), name
    for module in MODULE.findall(text):
        assert (ROOT / module.replace(".", "/") / "__main__.py").exists() or "CASE" in module, module


@pytest.mark.parametrize("page", PAGES, ids=by_place)
def test_named_tests_and_functions_exist(page: Path) -> None:
    everything = "\n".join(text for path, text in sources().items() if not path.endswith(".md"))
    for name in LONG_NAME.findall(page.read_text(encoding="utf-8")):
        assert re.search(rf"\b{name}\b", everything), name


def test_the_index_of_equations_names_what_is_there() -> None:
    """Each item is in the file named before it, each test somewhere in the tests."""
    table = EQUATIONS.read_text(encoding="utf-8").partition("| Eq |")[2].partition("\n\n")[0]
    rows = table.splitlines()[2:]
    assert len(rows) == 13
    for row in rows:
        _, equation, _, places, tests, _ = re.split(r" ?\| ?", row)
        if not places:
            assert equation.startswith("12")
        for place in places.split("; "):
            file, *items = re.findall(r"`([^`]+)`", place)
            (path,) = ending_with(file)
            for item in items:
                name = item.rpartition("::")[2] or item
                assert re.search(rf"\b{name}\b", sources()[path]) or ending_with(name), (equation, item)
        for name in re.findall(r"`([a-z_]+)`", tests):
            assert any(f"fn {name}(" in text for text in sources().values()), (equation, name)


def folders_of_the_layout(tree: str) -> list[str]:
    """The folders that an indented tree lists, each from the top folder."""
    found: list[str] = []
    above: list[tuple[int, str]] = []
    for line in tree.splitlines():
        indent = len(line) - len(line.lstrip())
        above = [(depth, name) for depth, name in above if depth < indent]
        parent = above[-1][1] if above else ""
        names = re.split(r"/(?:, |\s|$)", line.strip())[: line.count("/,") + 1]
        found += [f"{parent}{name}/" for name in names]
        above.append((indent, found[-1]))
    return found


def test_the_layout_is_that_of_the_core() -> None:
    """CONTRIBUTING.md lists all crates, and all folders of the solver and of the package."""
    tree = CONTRIBUTING.read_text(encoding="utf-8").partition("## Layout")[2].split("```\n")[1]
    listed = folders_of_the_layout(tree)
    for folder in listed:
        assert (ROOT / folder).is_dir(), folder
    for parent in ("crates/", "crates/sandboil-solver/src/", "python/sandboil/"):
        there = {f"{parent}{path.name}/" for path in (ROOT / parent).glob("[a-z]*/")}
        assert there <= set(listed)


def test_pages_named_in_the_sources_exist() -> None:
    for path, text in sources().items():
        if path.endswith((".rs", ".py", ".pyi", ".toml")) and not path.startswith("tests/"):
            for page in re.findall(r"\b(?:docs|validation)/[\w/]+\.md\b", text):
                assert (ROOT / page).exists(), (path, page)


def test_every_picture_is_shown() -> None:
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in LINK.findall(page.read_text(encoding="utf-8"))
    }
    for picture in [*ROOT.glob("docs/**/*.png"), *ROOT.glob("validation/**/*.png")]:
        assert picture.resolve() in shown, picture


def test_the_index_of_the_validation_is_that_of_its_pages() -> None:
    """`python -m validation` writes it."""
    assert INDEX.read_text(encoding="utf-8") == index()
