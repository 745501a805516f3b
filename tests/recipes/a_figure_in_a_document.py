"""A figure in a document"""

CHANGES = {
    "docs/figures.toml": (
        (
            "[broad]\n",
            """\
[made]
command = "h2nav demo"
machine = "any"
measured = 2026-11-26
[made.figures]
apart = "1.46 m"

[broad]
""",
        ),
    ),
    "docs/glossary.md": (
        (
            "# Glossary\n",
            "# Glossary\n\nA made one is 1.5 m <!-- made.apart --> away.\n",
        ),
    ),
}

if __name__ == "__main__":
    from pathlib import Path

    import needs
    import pytest

    needs.REPOSITORY = Path.cwd()
    from unit import test_figures as held

    assert ("docs/glossary.md", "made", "apart", "1.5 m") in held.marks()
    held.test_every_quoted_figure_is_that_of_the_source()
    held.test_every_comment_is_a_mark()
    held.test_every_source_is_used_and_says_how_it_was_measured()
    # Another value than the source's is noticed.
    held.SOURCE["made"]["figures"]["apart"] = "1.64 m"
    with pytest.raises(AssertionError, match=r"made\.apart"):
        held.test_every_quoted_figure_is_that_of_the_source()
