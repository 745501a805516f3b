"""Pictures as PNG files, drawn without a display; imports matplotlib on demand."""

from pathlib import Path
from typing import Any

from h2nav.errors import BadInput


def pyplot() -> Any:
    """The module `matplotlib.pyplot`, drawing into memory.

    Raises:
        BadInput: matplotlib is not installed.
    """
    try:
        import matplotlib as mpl
    except ImportError:
        raise BadInput(
            "--plots: matplotlib is not installed; remedy: pip install 'h2nav[plots]'"
        ) from None
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    return plt


def save(figure: Any, path: Path, dpi: int = 110) -> None:
    """Writes and closes a figure."""
    figure.savefig(path, dpi=dpi, pil_kwargs={"optimize": True})
    pyplot().close(figure)
