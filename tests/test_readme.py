"""What README and the guide show runs as it is written, over less time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sandboil import Run, lab
from sandboil.run import plan

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [README, *sorted(ROOT.glob("docs/guide/*.md"))]
# Times that are shortened: of shaking, and of the moment at which results are read.
SHORTER = (("duration=20.0", "duration=1.0"), ("time=10.0", "time=1.0"))


def python_of(page: Path) -> str:
    """The Python of a page in the order in which it is written."""
    return "".join(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))


def commands_of(page: Path) -> list[str]:
    """The commands in the blocks of a page."""
    blocks = re.findall(r"```\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


@pytest.fixture
def short_trials(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Plans that take little time, and a folder for the results."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plan, "TRIAL_SECONDS", 0.2)


def run(page: Path) -> dict[str, object]:
    """Run the Python of a page; the names that it leaves."""
    code = python_of(page)
    for long, short in SHORTER:
        code = code.replace(long, short)
    names: dict[str, object] = {}
    exec(compile(code, page.name, "exec"), names)
    return names


@pytest.mark.usefixtures("short_trials")
def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    assert all(long in python_of(README) for long, _ in SHORTER)
    names = run(README)
    assert isinstance(names["run"], Run)
    assert (tmp_path / "out" / "sand" / "histories.csv").is_file()
    assert isinstance(names["test"], lab.CyclicTest)
    assert (tmp_path / "dss.png").is_file()


@pytest.mark.usefixtures("short_trials")
@pytest.mark.parametrize("page", [page for page in PAGES[1:] if python_of(page)], ids=lambda page: page.stem)
def test_the_python_of_the_guide_runs(page: Path) -> None:
    assert run(page)


def test_the_guide_shows_python() -> None:
    shown = {page.stem for page in PAGES[1:] if python_of(page)}
    assert shown == {page.stem for page in PAGES[1:]} - {"README", "command_line"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_examples_in_commands_exist(page: Path) -> None:
    examples = re.findall(r"examples/\S+", "\n".join(commands_of(page)))
    assert examples or page != README
    assert all((ROOT / path).exists() for path in examples)


def test_the_demonstration_is_what_the_readme_shows_by_hand() -> None:
    """`make demo` gives the commands of the README, with its scene and folder."""
    made = (ROOT / "Makefile").read_text(encoding="utf-8")
    for name, value in re.findall(r"^(\w+) := (\S+)$", made, re.MULTILINE):
        made = made.replace(f"$({name})", value)
    by_hand = [" ".join(line.split()) for line in commands_of(README) if "out/level_ground" in line]
    assert len(by_hand) == 2
    for command in by_hand:
        assert command.removeprefix("sandboil ") in made
