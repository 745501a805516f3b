"""What is derived from the float kernel: as near to it as is claimed, refused where it must be."""

import functools
import random
from collections.abc import Mapping
from types import CodeType
from typing import Any

import pytest
from needs import tool

from h2nav.attitude.record import Grid, assign, grids_of, rows
from h2nav.attitude.velocity_aided import memory as floats
from h2nav.attitude.velocity_aided.integer import memory as integers
from h2nav.attitude.velocity_aided.integer.kernel import derived
from h2nav.attitude.velocity_aided.integer.kernel.functions import limited
from h2nav.attitude.velocity_aided.kernel import aiding, heading, prediction, theta, velocity
from h2nav.translate import fixed_values as fixed
from h2nav.translate.derivation import Derived, Operand, Recipe, derive
from h2nav.translate.fixed_values import Underivable
from h2nav.translate.recipes_velocity_aided import RECIPES, fields
from h2nav.translate.source import Kernel, KernelSource, read_kernel

ROUNDS = 300
FIELDS = fields()
FLOAT_MODULES = (prediction, theta, aiding, velocity, heading)


@pytest.fixture(scope="module")
def found() -> list[Derived]:
    return list(tool("derive").found())


def test_module_and_page_are_those_of_the_float_kernel(found: list[Derived]) -> None:
    made = tool("derive")
    assert made.MODULE.read_text(encoding="utf-8") == made.module(found), "run tools/derive.py"
    assert made.FIELDS.read_text(encoding="utf-8") == made.shared_fields()
    text = made.PAGE.read_text(encoding="utf-8")
    assert text == made.page(found, text), "run python tools/derive.py"


# near the float kernel


def drawn(rng: random.Random, low: int, high: int) -> int:
    """An end, anything, or anything of any size."""
    way = 6.0 * rng.random()
    if way < 1.0:
        return low if way < 0.5 else high
    if way < 2.0:
        return low + int((high - low + 1) * rng.random())
    size = 1 << int((max(high, -low).bit_length() + 1) * rng.random())
    return max(low, min(high, int((2 * size + 1) * rng.random()) - size))


@functools.cache
def ranges(record_type: type) -> list[tuple[int, int]]:
    """Of all numbers of a record, without the very ends of the large ones."""
    found = []
    for one in rows(record_type):
        low, high = one.range or (0, 0)
        if high > 1 << 20:
            # at the very ends a local variable saturates, too, which the bound leaves out
            low, high = low - (low >> 4) if low < 0 else low, high - (high >> 4)
        found += [(low, high)] * one.length
    return found


def drawn_record(rng: random.Random, record_type: type) -> Any:
    record = record_type()
    assign(record, record_type, [drawn(rng, *ends) for ends in ranges(record_type)])
    return record


@functools.cache
def compiled(text: str) -> CodeType:
    return compile(text, "<operand>", "eval")


class Case:
    """One call of a derived function, and of its origin on the same numbers."""

    def __init__(self, recipe: Recipe, rng: random.Random) -> None:
        self.recipe = recipe
        self.s = drawn_record(rng, integers.State)
        self.g = drawn_record(rng, integers.Gains)
        # a count below 4 shifts to the left by so few places that `shifted` limits what it takes
        self.s.k_tilt_s, self.s.k_velocity_s = rng.randint(4, 30), rng.randint(4, 30)
        # with a latency below 16 ms the turn of a field counts for no more than the innovation does
        self.s.mag_lag = rng.randint(0, 2000)
        self.names: dict[str, Any] = {"s": self.s, "g": self.g, "limited": limited}
        self.names["r"] = [rng.randint(-32767, 32767) for _ in range(9)]
        end = (1 << 30) - 1
        self.names["step"] = [drawn(rng, -end, end) for _ in range(4)]
        for axis in "xyz":
            self.names[f"before_{axis}"] = drawn(rng, 256, end)
        self.float_s, self.float_w = floats.State(), floats.Workspace()
        self.float_g = floats.Gains()
        self.operands: Mapping[str, Operand] = {**FIELDS, **recipe.operands}
        for operand in recipe.operands.values():
            if operand.text.isidentifier() and operand.text not in self.names:
                grid = operand.grids[0]
                self.names[operand.text] = drawn(rng, grid.low, grid.high)
        self._fill()

    def number(self, operand: Operand) -> Any:
        """What the integers of an operand stand for."""
        integer = eval(compiled(operand.text), {}, self.names)
        power = 0
        if operand.fall:
            power = -eval(compiled(operand.fall), {}, self.names)
        if isinstance(integer, list):
            grids = operand.grids * len(integer) if len(operand.grids) == 1 else operand.grids
            return [n * grid.step * 2.0**power for n, grid in zip(integer, grids, strict=False)]
        return integer * operand.grids[0].step * 2.0**power

    def _fill(self) -> None:
        owners = {"s": self.float_s, "w": self.float_w, "g": self.float_g}
        numbers = {name: self.number(operand) for name, operand in self.operands.items()}
        for name, value in {**numbers, **self.recipe.constants}.items():
            owner, _, attribute = name.partition(".")
            if attribute:
                setattr(owners[owner], attribute, value)

    def run(self) -> None:
        names = [argument.split(":")[0] for argument in self.recipe.arguments]
        getattr(derived, self.recipe.name)(*(self.names[name] for name in names))

    def run_floats(self) -> None:
        (function,) = (
            getattr(module, self.recipe.source)
            for module in FLOAT_MODULES
            if getattr(getattr(module, self.recipe.source, None), "__module__", "")
            == module.__name__
        )
        given = {"s": self.float_s, "w": self.float_w, "g": self.float_g}
        arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
        plain = {name: self.number(o) for name, o in self.operands.items() if "." not in name}
        function(*({**given, **plain}.get(name, 0.0) for name in arguments))


def element(record: Any, name: str) -> float:
    """A number by a name such as ``s.p_accel[2]``."""
    attribute, _, index = name.partition(".")[2].partition("[")
    value = getattr(record, attribute)
    return value[int(index.rstrip("]"))] if index else value


def grid_of(name: str, operands: Mapping[str, Operand]) -> Grid:
    attribute, _, index = name.partition("[")
    grids = operands[attribute].grids
    return grids[int(index.rstrip("]"))] if index and len(grids) > 1 else grids[0]


@pytest.mark.parametrize("name", [recipe.name for recipe in RECIPES])
def test_it_is_as_near_to_the_floats_as_its_bound_says(name: str, found: list[Derived]) -> None:
    (made,) = (one for one in found if one.recipe.name == name)
    rng = random.Random(f"2026-11-25 {name}")
    nearest = 0.0
    for _ in range(ROUNDS):
        case = Case(made.recipe, rng)
        case.run_floats()
        case.run()
        for bound in made.bounds.values():
            grid = grid_of(bound.name, case.operands)
            exact = element(case.float_s, bound.name)
            if bound.saturates:
                exact = max(grid.low * grid.step, min(grid.high * grid.step, exact))
            error = abs(element(case.s, bound.name) * grid.step - exact)
            assert error <= bound.error + 1e-9 * abs(exact) + 1e-9 * grid.step, bound
            if bound.error > 0.0:
                nearest = max(nearest, error / bound.error)
    # a bound a thousand times too large would say nothing
    assert nearest > 0.01 or all(bound.error == 0.0 for bound in made.bounds.values())


# what comes out of small functions

TEXT = """
def work(s: State, x: float, y: float) -> None:
    s.a = s.a + 0.25 * x * y
    s.b = x - y
"""
A = Grid(2.0**-10, -1000, 1000, saturates=True)


def kernel_of(text: str) -> Kernel:
    return read_kernel([KernelSource("small.py", text)])


def made_of(text: str, writes: tuple[str, ...] = ("s.a",), **grids: Grid) -> str:
    operands = {name.replace("__", "."): Operand(name, (grid,)) for name, grid in grids.items()}
    recipe = Recipe("work", "work", writes, ("s: State",), operands)
    return derive(kernel_of(text), recipe, {}).text


def test_only_what_is_named_is_taken() -> None:
    wide = Grid(2.0**-10, -(1 << 15), (1 << 15) - 1)
    text = made_of(TEXT, ("s.a",), s__a=A, s__b=A, x=wide, y=wide)
    assert "s__a = limited(s__a + ((x * y + 2048) >> 12), 1000)" in text
    assert "s__b" not in text


@pytest.mark.parametrize(
    "expression",
    ["-x", "y - -x", "-0.25 - x", "x * -0.25", "-(x + 0.125)", "-(-x)", "-x * y", "-K + x", "-K"],
)
def test_what_is_negated_has_the_other_sign(expression: str) -> None:
    """A constant, a variable or what is in brackets; to one step of the result."""
    head = "\nK = 0.125\n\n\ndef work(s: State, x: float, y: float) -> None:\n"
    wide = Grid(2.0**-10, -(1 << 20), 1 << 20, saturates=True)
    text = made_of(f"{head}    s.a = {expression}\n", s__a=wide, x=A, y=A)
    (line,) = (line for line in text.splitlines() if "s__a =" in line)
    for x, y in ((-1000, 999), (-3, 700), (0, 0), (5, -70), (1000, 1000)):
        names = {"x": x, "y": y, "limited": limited}
        found = eval(line.split(" = ")[1], names) * 2.0**-10
        exact = eval(expression, {"x": x * 2.0**-10, "y": y * 2.0**-10, "K": 0.125})
        assert found == pytest.approx(exact, abs=2.0**-10)


def test_a_wide_factor_is_taken_in_halves() -> None:
    wide, narrow = Grid(2.0**-28, -(1 << 30), 1 << 30), Grid(2.0**-15, -32768, 32767)
    text = made_of(TEXT, ("s.a",), s__a=Grid(2.0**-28, -(1 << 30), 1 << 30, True), x=wide, y=narrow)
    assert "product(x, y)" in text


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("s.a = s.a + z", "z has no declared format"),
        ("s.a = s.a + math.sqrt(x)", "is by hand"),
        ("s.c = s.c + x", "declared -3..3"),
        ("s.a = x / y", "not negative"),
        # what is not zero may lie on either side of it
        ("z = x\n    if z != 0.0:\n        s.d = z", r"-1000\.\.1000, declared 0\.\.1000"),
        ("while x > y:\n        s.a = x", "writes nothing"),
    ],
)
def test_refusals_name_the_place(text: str, reason: str) -> None:
    few, positive = Grid(2.0**-10, -3, 3), Grid(2.0**-10, 0, 1000)
    grids = {"s__a": A, "s__c": few, "s__d": positive, "x": A, "y": A}
    body = f"\ndef work(s: State, x: float, y: float, z: float) -> None:\n    {text}\n"
    with pytest.raises(Underivable, match=reason):
        made_of(body, ("s.a", "s.c", "s.d"), **grids)


def test_a_part_that_reads_what_the_rest_has_written_is_refused() -> None:
    body = "\ndef work(s: State, x: float) -> None:\n    s.b = x\n    s.a = s.b\n"
    with pytest.raises(Underivable, match=r"s\.b is written by what is left out"):
        made_of(body, ("s.a",), s__a=A, s__b=A, x=A)


def test_forms_say_step_and_range() -> None:
    assert grids_of((4, 0.5, -2.0, 2.0)) == (Grid(1 / 32, -31, 31, True, 4, 0.5),)
    assert grids_of((4, 1.0, 0.125, 2.0)) == (Grid(1 / 16, 2, 31, True, 4, 1.0),)
    assert [grid.step for grid in grids_of((0, (1.0, 3.0), -2.0, 2.0))] == [1.0, 3.0]
    assert grids_of(None) == ()


def test_a_quotient_of_unrelated_steps_is_refused() -> None:
    with pytest.raises(Underivable, match="power of two"):
        fixed.quotient(fixed.variable("a", 0, 9, 1.0), fixed.variable("b", 1, 9, 3.0))
