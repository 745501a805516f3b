"""The pictures of `evaluate paper --plots` and the share of stable attitudes."""

from pathlib import Path

import pytest

from h2nav.errors import BadInput
from h2nav.evaluation.paper.pictures import draw_cases
from h2nav.evaluation.paper.trials import Assumptions

pytestmark = pytest.mark.thorough

PICTURES = {
    "case_1_motion.png",
    "case_1_errors.png",
    "case_2_motion.png",
    "case_2_errors.png",
    "stable_region.png",
}


def test_pictures_are_drawn(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"
    draw_cases(Assumptions(run_in_s=0.0), folder)
    assert {path.name for path in folder.iterdir()} == PICTURES
    for path in folder.iterdir():
        content = path.read_bytes()
        assert content.startswith(b"\x89PNG")
        assert 20_000 < len(content) < 200_000


def test_unwritable_folder_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(BadInput, match=r"--plots .*cannot be written"):
        draw_cases(Assumptions(run_in_s=0.0), file)
