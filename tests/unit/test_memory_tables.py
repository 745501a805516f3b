"""docs/memory.md is what tools/memory_tables.py makes of the kernels' records."""

import importlib.util

from needs import REPOSITORY


def test_the_page_is_that_of_the_records() -> None:
    spec = importlib.util.spec_from_file_location(
        "memory_tables", REPOSITORY / "tools" / "memory_tables.py"
    )
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert tool.PAGE.read_text(encoding="utf-8") == tool.page(), "run python tools/memory_tables.py"
