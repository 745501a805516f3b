"""A plot of the viewers' layouts"""

CHANGES = {
    "tools/layouts.py": (
        (
            "SENSORS = (\n",
            'SENSORS = (\n    Plot("A made one [m/s]", "/aiding", ("north_m_s", "east_m_s")),\n',
        ),
    ),
}
WRITTEN = ("packaging/layouts/foxglove.json", "packaging/layouts/plotjuggler.xml")

if __name__ == "__main__":
    import subprocess
    import sys
    from pathlib import Path

    subprocess.run([sys.executable, "tools/layouts.py"], check=True)
    assert all("A made one" in Path(one).read_text(encoding="utf-8") for one in WRITTEN)
