"""What tools make of the kernels' declarations is in the repository as they make it."""

import importlib.util
import json
import shutil
import subprocess
from types import ModuleType

import pytest
from needs import REPOSITORY

from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.attitude.kernel_files import COMPILED, sources
from h2nav.files.plain_yaml import read_mapping


def tool_of(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, REPOSITORY / "tools" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


def test_the_page_of_the_memory_is_that_of_the_records() -> None:
    tool = tool_of("memory_tables")
    assert tool.PAGE.read_text(encoding="utf-8") == tool.page(), "run python tools/memory_tables.py"


def test_table_and_schema_of_the_parameters_are_those_of_their_rows() -> None:
    tool = tool_of("parameter_tables")
    text = tool.PAGE.read_text(encoding="utf-8")
    assert text == tool.page(text), "run python tools/parameter_tables.py"
    assert tool.SCHEMA.read_text(encoding="utf-8") == tool.schema()


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
