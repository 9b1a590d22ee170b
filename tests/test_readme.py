"""What the README shows runs as it stands, over less time."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sandboil import Run, lab
from sandboil.run import plan

README = Path(__file__).parents[1] / "README.md"


def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "".join(re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL))
    shorter = code.replace("duration=20.0", "duration=1.0").replace("time=10.0", "time=1.0")
    assert shorter.count("=1.0") >= code.count("=1.0") + 2
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plan, "TRIAL_SECONDS", 0.2)
    names: dict[str, object] = {}
    exec(compile(shorter, README.name, "exec"), names)
    assert isinstance(names["run"], Run)
    assert (tmp_path / "out" / "sand" / "histories.csv").is_file()
    assert isinstance(names["test"], lab.CyclicTest)
    assert (tmp_path / "dss.png").is_file()


def test_the_commands_of_the_readme_are_those_of_the_example() -> None:
    examples = re.findall(r"examples/\S+", README.read_text(encoding="utf-8"))
    assert examples
    assert all((README.parent / path).exists() for path in examples)
