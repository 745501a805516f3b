"""Builds the optional native batch extension; everything else stands in pyproject.toml.

The C is translated from the Python kernels here, at build time. Without a compiler, or for a
kernel that does not translate, the installation goes on without the extension. The extension keeps
to the stable part of Python's interface, so that one wheel serves every version from 3.11 on.
H2NAV_NATIVE=forbid leaves it out: the wheel is then one for every machine.
"""

import os
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CompileError

ROOT = Path(__file__).resolve().parent
sys.path.insert(0, str(ROOT))

from h2nav.attitude.kernel_files import COMPILED, digest  # noqa: E402
from h2nav.errors import BadInput  # noqa: E402
from h2nav.translate.batch import batch_c, kernels_h  # noqa: E402
from h2nav.translate.source import KernelSource  # noqa: E402

PACKAGE = ROOT / "h2nav"
OLDEST_PYTHON = "0x030B0000"
STABLE_ABI = "cp311"


class TranslateAndBuild(build_ext):
    """Writes the kernels' C into the build folder before compiling it."""

    def build_extension(self, ext: Extension) -> None:
        """Translates every kernel of the extension, then compiles."""
        folder = Path(self.build_temp) / "kernels"
        folder.mkdir(parents=True, exist_ok=True)
        texts = []
        for kernel in COMPILED:
            paths = [PACKAGE / kernel.room / path for path in kernel.paths]
            sources = [KernelSource(str(path), path.read_text(encoding="utf-8")) for path in paths]
            texts += [(PACKAGE / path).read_text(encoding="utf-8") for path in kernel.files]
            target = folder / f"{kernel.name}.c"
            try:
                target.write_text(batch_c(kernel, sources), encoding="utf-8")
            except BadInput as error:
                raise CompileError(str(error)) from error
            ext.sources.append(str(target))
        (folder / "kernels.h").write_text(kernels_h(COMPILED), encoding="utf-8")
        ext.include_dirs += [str(folder), str(ROOT / "native")]
        ext.define_macros.append(("KERNEL_DIGEST", f'"{digest(texts)}"'))
        if self.compiler.compiler_type != "msvc":
            # fused multiply-add would make the doubles differ from Python's
            ext.extra_compile_args = ["-std=c99", "-O2", "-ffp-contract=off"]
        super().build_extension(ext)

    def copy_extensions_to_source(self) -> None:
        """Leaves no older extension, for one Python version alone, that would be found first."""
        super().copy_extensions_to_source()
        for ext in self.extensions:
            built = Path(self.get_ext_filename(ext.name)).name
            for other in (PACKAGE / "attitude").glob("_native.*.so"):
                if other.name != built:
                    other.unlink()


NATIVE = Extension(
    "h2nav.attitude._native",
    ["native/module.c", "native/likelihood.c"],
    define_macros=[("Py_LIMITED_API", OLDEST_PYTHON)],
    py_limited_api=True,
    optional=True,
)
is_wanted = os.environ.get("H2NAV_NATIVE") != "forbid"
setup(
    ext_modules=[NATIVE] if is_wanted else [],
    cmdclass={"build_ext": TranslateAndBuild},
    options={"bdist_wheel": {"py_limited_api": STABLE_ABI}} if is_wanted else {},
)
