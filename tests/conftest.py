"""What several test files read: one finished run of the small column."""

from __future__ import annotations

import pytest
import scenes
from sandboil import Run, run


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return run(scenes.column(), tmp_path_factory.mktemp("finished"), threads=1)
