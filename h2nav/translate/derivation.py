"""Derives integer functions from those of the float kernel and the formats of their variables.

The statements stay; each expression is rewritten in integers by `fixed_values`. Of a function only
the part is taken that writes the named fields, so that a schedule may spread one float function
over several samples. What comes out is Python of the translatable subset: `c99` writes its C and
proves again, knowing nothing of this module, that nothing leaves 32 bits.

Source: docs/design/007-one-kernel.md.
"""

import ast
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from h2nav.attitude.record import Grid
from h2nav.translate import fixed_values as fixed
from h2nav.translate.fixed_values import FixedValue, Scale, Underivable
from h2nav.translate.intervals import Interval
from h2nav.translate.source import Kernel

Result = FixedValue | float
_INDENT = "    "
_NOTHING: Mapping[str, Any] = MappingProxyType({})


class Operand(NamedTuple):
    """What stands in the integers for a variable of the float kernel."""

    text: str  # of the integer variable, or of the list that `[i]` follows
    grids: tuple[Grid, ...]  # one, or one per element
    fall: str = ""  # the variable whose power of two divides it
    fall_range: tuple[int, int] = (0, 0)

    def value(self, index: int | None, subscript: str) -> FixedValue:
        """The operand, or one of its elements."""
        grid = self.grids[0 if index is None or len(self.grids) == 1 else index]
        text = self.text if index is None else f"{self.text}[{subscript}]"
        found = fixed.variable(text, grid.low, grid.high, grid.step)
        if self.fall:
            found = found._replace(scale=Scale(self.fall, Interval(*self.fall_range)))
        return found


class Recipe(NamedTuple):
    """One integer function and where it comes from."""

    name: str  # of the integer function
    source: str  # function of the float kernel
    writes: tuple[str, ...]  # what it writes, such as "s.p_xx"; the rest is left out
    arguments: tuple[str, ...]  # with annotations, such as "s: State"
    # what stands for variables other than the fields of state and gains
    operands: Mapping[str, Operand] = _NOTHING
    # formats of local variables, and of parts of expressions by their text; what is not named is as
    # fine as 32 bits allow
    locals: Mapping[str, Grid] = _NOTHING
    constants: Mapping[str, float] = _NOTHING  # variables that are constant in the integers


class Bound(NamedTuple):
    """What was found of one written variable."""

    name: str
    error_steps: float  # largest error of one update, in its steps
    error: float  # the same in its unit
    saturates: bool  # it is moved into its range; else the sum is proved to be inside


class Derived(NamedTuple):
    """An integer function."""

    recipe: Recipe
    text: str  # Python
    bounds: Mapping[str, Bound]  # of what it writes, by its name


def derive(kernel: Kernel, recipe: Recipe, fields: Mapping[str, Operand]) -> Derived:
    """Derives one function.

    Args:
        kernel: the float kernel.
        recipe: what to derive.
        fields: the integers behind the fields of state and gains, such as "s.p_xx".

    Raises:
        Underivable: an expression has no integer form, or a variable may leave its range.
    """
    return _Derivation(kernel, recipe, fields).derived()


class _Derivation:
    def __init__(self, kernel: Kernel, recipe: Recipe, fields: Mapping[str, Operand]) -> None:
        self._kernel = kernel
        self._recipe = recipe
        self._operands = {**fields, **recipe.operands}
        self._locals: dict[str, FixedValue] = {}
        self._passes: dict[str, int] = {}  # loop variables and their present value
        self._unrolls = False
        self._bounds: dict[str, Bound] = {}

    def derived(self) -> Derived:
        """The whole function."""
        function = self._kernel.functions.get(self._recipe.source)
        if function is None:
            raise Underivable(f"{self._recipe.name}: no float function {self._recipe.source}")
        body = _sliced(function.node.body, set(self._recipe.writes))
        if not body:
            raise Underivable(f"{self._recipe.name}: writes nothing of {self._recipe.writes}")
        left = _fields(function.node.body, ast.Store) - set(self._recipe.writes)
        for name in sorted(left & _fields(body, ast.Load)):
            raise Underivable(f"{self._recipe.name}: {name} is written by what is left out")
        about = (ast.get_docstring(function.node) or "").strip()
        lines = [f"def {self._recipe.name}({', '.join(self._recipe.arguments)}) -> None:"]
        docstring = about.split("\n\nArgs:")[0].split("\n\nSource:")[0]
        source = about[about.index("Source:") :] if "Source:" in about else ""
        origin = f"From `{self._recipe.source}`: {', '.join(self._recipe.writes)}."
        marked = "\n\n".join(
            part for part in (docstring, textwrap.fill(origin, 94), source) if part
        )
        lines.append(_indented(f'"""{marked}\n"""', _INDENT))
        try:
            lines += self._block(body, _INDENT)
        except Underivable as error:
            raise Underivable(f"{self._recipe.name}: {error}") from None
        return Derived(self._recipe, "\n".join(lines) + "\n", self._bounds)

    # statements

    def _block(self, body: Sequence[ast.stmt], indent: str) -> list[str]:
        return [line for node in body for line in self._statement(node, indent)]

    def _statement(self, node: ast.stmt, indent: str) -> list[str]:
        match node:
            case ast.Assign(targets=[target], value=value):
                return [indent + self._assigned(target, value)]
            case ast.If(test=test, body=body, orelse=orelse):
                return self._if(test, body, orelse, indent)
            case ast.For(
                target=ast.Name(id=name),
                iter=ast.Call(func=ast.Name(id="range"), args=[ast.Constant(value=int() as stop)]),
                body=body,
            ):
                return self._for(name, stop, body, indent)
        raise Underivable(f"line {node.lineno}: {type(node).__name__} is by hand")

    def _assigned(self, target: ast.expr, value: ast.expr) -> str:
        if isinstance(target, ast.Name):
            return self._set_local(target.id, value)
        operand, index, subscript = self._place(target)
        grid = operand.grids[0 if index is None or len(operand.grids) == 1 else index]
        if operand.fall:
            raise Underivable(f"{ast.unparse(target)} has a scale that only its maker may set")
        raw = self._settled(value, grid.step)
        text = operand.text if index is None else f"{operand.text}[{subscript}]"
        kept = fixed.limited(raw, grid.low, grid.high)
        if kept is not raw and not grid.saturates:
            raise Underivable(
                f"{ast.unparse(target)} may be {raw.range.lo}..{raw.range.hi}, "
                f"declared {grid.low}..{grid.high}"
            )
        self._note(ast.unparse(target), kept, grid, saturates=kept is not raw)
        return f"{text} = {kept.text}"

    def _note(self, name: str, value: FixedValue, grid: Grid, *, saturates: bool) -> None:
        for loop, number in self._passes.items():
            name = name.replace(f"[{loop}]", f"[{number}]")
        steps = value.error / grid.step
        known = self._bounds.get(name)
        if known is not None:
            steps = max(steps, known.error_steps)
            saturates = saturates or known.saturates
        self._bounds[name] = Bound(name, steps, steps * grid.step, saturates)

    def _set_local(self, name: str, value: ast.expr) -> str:
        grid, known = self._recipe.locals.get(name), self._locals.get(name)
        if grid is not None:
            made = self._settled(value, grid.step)
            kept = fixed.limited(made, grid.low, grid.high)
            if kept is not made and not grid.saturates:
                raise Underivable(f"{name} may be {made.range.lo}..{made.range.hi}")
            made = kept
        elif known is not None and known.scale is None and not self._passes:
            made = self._settled(value, known.step)
        else:
            found = self._value(value, None)
            if isinstance(found, float):
                if known is None:
                    raise Underivable(f"{name} = {found}: a constant needs a declared format")
                found = fixed.number(found, known.step)
            made = found
        self._locals[name] = made.named(name)
        return f"{name} = {made.text}"

    def _if(
        self, test: ast.expr, body: list[ast.stmt], orelse: list[ast.stmt], indent: str
    ) -> list[str]:
        lines = [f"{indent}if {self._test(test)}:"]
        before = dict(self._locals)
        self._narrow(test, truth=True)
        lines += self._block(body, indent + _INDENT)
        taken, self._locals = self._locals, before
        self._narrow(test, truth=False)
        if orelse:
            lines += [f"{indent}else:", *self._block(orelse, indent + _INDENT)]
        for name in taken.keys() & self._locals.keys():
            a, b = taken[name], self._locals[name]
            if a.step != b.step or a.scale != b.scale:
                raise Underivable(f"{name} has two formats")
            self._locals[name] = a._replace(
                range=a.range.hull(b.range), error=max(a.error, b.error)
            )
        return lines

    def _for(self, name: str, stop: int, body: list[ast.stmt], indent: str) -> list[str]:
        texts: list[list[str]] = []
        for number in range(stop):
            self._passes[name] = number
            texts.append(self._block(body, indent + _INDENT))
        if all(text == texts[0] for text in texts):
            del self._passes[name]
            return [f"{indent}for {name} in range({stop}):", *texts[0]]
        lines = []
        unrolls, self._unrolls = self._unrolls, True
        for number in range(stop):
            self._passes[name] = number
            lines += self._block(body, indent)
        self._unrolls = unrolls
        del self._passes[name]
        return lines

    # tests

    def _test(self, node: ast.expr) -> str:
        match node:
            case ast.BoolOp(op=operator, values=values):
                word = " and " if isinstance(operator, ast.And) else " or "
                return word.join(f"({self._test(value)})" for value in values)
            case ast.Compare(left=left, ops=[operator], comparators=[right]):
                a, b = self._pair(left, right)
                return f"{a.text} {_SIGNS[type(operator)]} {b.text}"
        raise Underivable(f"{ast.unparse(node)}: a test compares two numbers")

    def _pair(self, left: ast.expr, right: ast.expr) -> tuple[FixedValue, FixedValue]:
        a, b = self._value(left, None), self._value(right, None)
        if isinstance(a, float) and isinstance(b, float):
            raise Underivable("two constants are compared")
        if isinstance(a, float):
            assert isinstance(b, FixedValue)
            return fixed.number(a, b.step), b
        if isinstance(b, float):
            return a, fixed.number(b, a.step)
        return fixed.compared(a, b)

    def _narrow(self, test: ast.expr, *, truth: bool) -> None:
        """Limits a local variable to what its comparison with a constant leaves."""
        match test:
            case ast.Compare(
                left=ast.Name(id=name),
                ops=[ast.Lt() | ast.LtE() | ast.Gt() | ast.GtE() as operator],
                comparators=[right],
            ) if name in self._locals:
                bound = self._value(right, None)
                if not isinstance(bound, float):
                    return
                value = self._locals[name]
                count = round(bound / value.step)
                low, high = value.range
                below = isinstance(operator, ast.Lt | ast.LtE)
                if below == truth:
                    high = min(high, count - (isinstance(operator, ast.Lt) and truth))
                else:
                    low = max(low, count + (isinstance(operator, ast.Gt) and truth))
                if low <= high:
                    self._locals[name] = value._replace(range=Interval(low, high))

    # expressions

    def _settled(self, node: ast.expr, step: float) -> FixedValue:
        """An expression with this step."""
        found = self._value(node, step)
        if isinstance(found, float):
            return fixed.number(found, step)
        return fixed.settled(found, step)

    def _value(self, node: ast.expr, wanted: float | None) -> Result:
        grid = self._recipe.locals.get(ast.unparse(node))
        if grid is not None and not isinstance(node, ast.Name):
            made = self._expression(node, grid.step)
            assert isinstance(made, FixedValue)
            return fixed.limited(fixed.settled(made, grid.step), grid.low, grid.high)
        return self._expression(node, wanted)

    def _expression(self, node: ast.expr, wanted: float | None) -> Result:
        match node:
            case ast.Constant(value=float() as value):
                return value
            case ast.Name(id=name) if name in self._locals:
                return self._locals[name]
            case ast.Name(id=name) if name in self._kernel.constants:
                constant = self._kernel.constants[name].value
                if isinstance(constant, int | float):
                    return float(constant)
            case ast.Name() | ast.Attribute() | ast.Subscript():
                given = self._recipe.constants.get(ast.unparse(node))
                if given is not None:
                    return given
                operand, index, subscript = self._place(node)
                return operand.value(index, subscript)
            case ast.BinOp(op=ast.Add() | ast.Sub()):
                return self._sum(node, wanted)
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return self._product(left, right, wanted)
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return self._quotient(left, right, wanted)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                found = self._value(operand, wanted)
                return -found if isinstance(found, float) else fixed.negated(found)
            case ast.Call(func=ast.Name(id=name)) if name in self._kernel.functions:
                return self._inlined(node, name, wanted)
        raise Underivable(f"{ast.unparse(node)} is by hand")

    def _inlined(self, node: ast.Call, name: str, wanted: float | None) -> Result:
        """The expression that a function returns, if it is that alone and takes records alone."""
        function = self._kernel.functions[name].node
        given = [ast.unparse(argument) for argument in node.args]
        body = function.body[1 if ast.get_docstring(function) else 0 :]
        if given == [argument.arg for argument in function.args.args]:
            match body:
                case [ast.Return(value=ast.expr() as value)]:
                    return self._value(value, wanted)
        raise Underivable(f"{ast.unparse(node)} is by hand")

    def _sum(self, node: ast.expr, wanted: float | None) -> Result:
        nodes = list(_terms(node, 1))
        found = [(sign, self._value(part, wanted)) for sign, part in nodes]
        constant = sum(sign * value for sign, value in found if isinstance(value, float))
        terms = [(sign, value) for sign, value in found if isinstance(value, FixedValue)]
        if not terms:
            return constant
        if constant:
            step = wanted or min(value.step for _, value in terms)
            terms.append((1 if constant > 0 else -1, fixed.number(abs(constant), step)))
        return fixed.added(terms, wanted)

    def _product(self, left: ast.expr, right: ast.expr, wanted: float | None) -> Result:
        a, b = self._value(left, None), self._value(right, None)
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if isinstance(a, float) or isinstance(b, float):
            factor, other = (a, right) if isinstance(a, float) else (b, left)
            assert isinstance(factor, float)
            if factor == 0.0:
                return 0.0
            part = self._value(other, None if wanted is None else wanted / abs(factor))
            assert isinstance(part, FixedValue)
            made = fixed.scaled(part, abs(factor))
            return made if factor > 0.0 else fixed.negated(made)
        if a.text == b.text:
            return fixed.squared(a)
        return fixed.multiplied(a, b, wanted)

    def _quotient(self, left: ast.expr, right: ast.expr, wanted: float | None) -> Result:
        b = self._value(right, None)
        if isinstance(b, float):
            found = self._value(left, None if wanted is None else wanted * b)
            return found / b if isinstance(found, float) else fixed.scaled(found, 1.0 / b)
        a = self._value(left, None)
        return fixed.quotient(fixed.number(a, b.step) if isinstance(a, float) else a, b)

    def _place(self, node: ast.expr) -> tuple[Operand, int | None, str]:
        """The operand, the number of its element, and how the integers write that number."""
        if isinstance(node, ast.Subscript):
            index = self._index(node.slice)
            subscript = str(index) if self._unrolls else ast.unparse(node.slice)
            return self._operand(node.value), index, subscript
        return self._operand(node), None, ""

    def _index(self, node: ast.expr) -> int:
        match node:
            case ast.Constant(value=int() as number):
                return number
            case ast.Name(id=name) if name in self._passes:
                return self._passes[name]
            case ast.BinOp(left=left, op=ast.Add(), right=right):
                return self._index(left) + self._index(right)
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                return self._index(left) * self._index(right)
        raise Underivable(f"the index {ast.unparse(node)} is by hand")

    def _operand(self, node: ast.expr) -> Operand:
        name = ast.unparse(node)
        if name not in self._operands:
            raise Underivable(f"{name} has no declared format")
        return self._operands[name]


_SIGNS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}


def _terms(node: ast.expr, sign: int) -> Iterator[tuple[int, ast.expr]]:
    match node:
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            yield from _terms(left, sign)
            yield from _terms(right, sign)
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            yield from _terms(left, sign)
            yield from _terms(right, -sign)
        case _:
            yield sign, node


def _sliced(body: Sequence[ast.stmt], wanted: set[str]) -> list[ast.stmt]:
    """The statements that `wanted` fields and local variables depend on; completes `wanted`."""
    kept: list[ast.stmt] = []
    for node in reversed(body):
        match node:
            case ast.Assign(targets=[target]) if _written(target) in wanted:
                kept.append(node)
                wanted |= _read(node)
            case ast.If(test=test, body=inner, orelse=other):
                parts = [_sliced(inner, wanted), _sliced(other, wanted)]
                if any(parts):
                    found = ast.If(test, parts[0] or [ast.Pass()], parts[1])
                    kept.append(ast.copy_location(found, node))
                    wanted |= _read(test)
            case ast.For(target=target, iter=bounds, body=inner):
                part = _sliced(inner, wanted)
                if part:
                    kept.append(ast.copy_location(ast.For(target, bounds, part, []), node))
    return kept[::-1]


def _fields(body: Sequence[ast.stmt], context: type[ast.expr_context]) -> set[str]:
    """Fields of records that statements read or write, a vector as a whole."""
    found = set()
    for node in (part for statement in body for part in ast.walk(statement)):
        match node:
            case ast.Subscript(value=ast.Attribute() as vector, ctx=ctx) if isinstance(
                ctx, context
            ):
                found.add(ast.unparse(vector))
            case ast.Attribute(ctx=ctx) if isinstance(ctx, context):
                found.add(ast.unparse(node))
    return found


def _written(target: ast.expr) -> str:
    """The variable, or the vector of the element, that an assignment writes."""
    return ast.unparse(target.value if isinstance(target, ast.Subscript) else target)


def _read(node: ast.AST) -> set[str]:
    return {
        part.id
        for part in ast.walk(node)
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Load)
    }


def _indented(text: str, indent: str) -> str:
    return "\n".join(indent + line if line else line for line in text.splitlines())
