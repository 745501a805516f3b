"""A plot of the viewers' layouts"""

CHANGES = {
    "tools/layouts.py": (
        (
            "SENSORS = (\n",
            'SENSORS = (\n    Plot("A made one [m/s]", "/aiding", ("north_m_s", "east_m_s")),\n',
        ),
    ),
}

if __name__ == "__main__":
    import subprocess
    import sys
    from pathlib import Path

    Path("packaging/layouts").mkdir(parents=True)
    subprocess.run([sys.executable, "tools/layouts.py"], check=True)
    written = list(Path("packaging/layouts").iterdir())
    assert len(written) >= 2
    assert all("A made one" in one.read_text(encoding="utf-8") for one in written)
