"""What tools make of the kernels' declarations is in the repository as they make it."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from needs import REPOSITORY, tool

from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.attitude.kernel_files import COMPILED, sources
from h2nav.files.plain_yaml import read_mapping


def test_the_page_of_the_memory_is_that_of_the_records() -> None:
    tables = tool("memory_tables")
    assert tables.PAGE.read_text(encoding="utf-8") == tables.page(), (
        "run python tools/memory_tables.py"
    )


def test_what_follows_from_the_parameters_is_that_of_their_rows() -> None:
    tables = tool("parameter_tables")
    text = tables.PAGE.read_text(encoding="utf-8")
    assert text == tables.page(text), "run python tools/parameter_tables.py"
    assert tables.SCHEMA.read_text(encoding="utf-8") == tables.schema()
    assert tables.FIELDS.read_text(encoding="utf-8") == tables.fields_module()


@pytest.mark.thorough
def test_a_misspelt_gain_is_an_error_to_the_type_checker(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    lines = (
        "from h2nav.attitude.velocity_aided import memory as floats",
        "from h2nav.attitude.velocity_aided.integer import memory as integers",
        "def read(f: floats.Gains, i: integers.Gains) -> tuple[float, int]:",
        "    return f.rest_gyro, i.mag_new_turn",
        "def misread(f: floats.Gains, i: integers.Gains) -> tuple[float, int]:",
        "    return f.rest_gyor, i.mag_new_trun",
    )
    snippet = tmp_path / "snippet.py"
    snippet.write_text("\n".join(lines), encoding="utf-8")
    # Without what has no part in it: the types of numpy, and a cache that nobody reads.
    without = ("--config-file=", "--no-site-packages", f"--cache-dir={os.devnull}")
    asked = (sys.executable, "-m", "mypy", *without, "--follow-imports=silent", snippet)
    checked = subprocess.run(asked, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    errors = re.findall(r"py:(\d+): error: .* (\S+)  \[attr-defined\]", checked.stdout)
    assert errors == [("6", '"rest_gyor"'), ("6", '"mag_new_trun"')], checked.stdout
    assert "Found 2 errors" in checked.stdout


@pytest.mark.parametrize("name", VEHICLE_CLASSES)
def test_the_schema_takes_the_class_models_and_no_unknown_key(name: str) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    models = REPOSITORY / "gains" / "models"
    schema = json.loads((models / "schema.json").read_text(encoding="utf-8"))
    model = read_mapping(models / f"{name}.yaml")
    jsonschema.validate(model, schema)
    changed = dict(model, disturbance={**model["disturbance"], "bias_wlak": 1.0})
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(changed, schema)


def test_make_installs_anew_after_a_change_of_any_compiled_kernel() -> None:
    assert all((REPOSITORY / path).is_file() for path in sources())
    assert {f"h2nav/{kernel.room}/{path}" for kernel in COMPILED for path in kernel.paths} <= set(
        sources()
    )
    if shutil.which("make") is None:
        pytest.skip("needs make")
    asked = ["make", "--dry-run", "--print-data-base", "help"]
    told = subprocess.run(asked, cwd=REPOSITORY, capture_output=True, text=True, check=True).stdout
    line = next(line for line in told.splitlines() if line.startswith("SOURCES :="))
    assert set(sources()) <= set(line.split())
