"""Writes the expressions of one kernel function in C, with the types that the analysis proved."""

import ast
import math
from typing import NamedTuple

from h2nav.translate.facts import Array, Facts, Float, FunctionFacts, Scalar
from h2nav.translate.intervals import Interval, subtract
from h2nav.translate.source import Function, Kernel, Number, Untranslatable

_ATOM, _UNARY, _PRODUCT, _SUM, _OTHER = 4, 3, 2, 1, 0
_OPERATORS: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", _SUM),
    ast.Sub: ("-", _SUM),
    ast.Mult: ("*", _PRODUCT),
    ast.Div: ("/", _PRODUCT),
    ast.BitAnd: ("&", _OTHER),
    ast.BitOr: ("|", _OTHER),
    ast.BitXor: ("^", _OTHER),
}
_COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
DOUBLE, INT32, INT64 = "double", "int32_t", "int64_t"


def c_number(value: Number) -> str:
    """A literal of exactly this value."""
    if isinstance(value, float):
        return repr(value)
    if value == -(1 << 31):
        return "(-INT32_C(2147483647) - 1)"
    bits = 32 if Interval(value, value).fits(32) else 64
    return f"INT{bits}_C({value})" if value >= 0 else f"(-INT{bits}_C({-value}))"


def c_type(kind: Scalar) -> str:
    """The C type that holds every value of a kind."""
    if isinstance(kind, Float):
        return DOUBLE
    return INT32 if kind.fits(32) else INT64


class CText(NamedTuple):
    """C text of an expression, how tightly it binds, its C type."""

    text: str
    level: int
    type: str

    def at(self, level: int) -> str:
        """The text, in parentheses where it binds less tightly than `level`."""
        return self.text if self.level >= level else f"({self.text})"

    def cast(self, type_name: str) -> "CText":
        """The text with an explicit conversion where the type differs."""
        if self.type == type_name:
            return self
        return CText(f"({type_name}){self.at(_UNARY)}", _UNARY, type_name)

    def widened(self, type_name: str) -> "CText":
        """Explicit only where C would not widen by itself, or leaves the integers."""
        explicit = (self.type == INT64 and type_name == INT32) or type_name == DOUBLE
        return self.cast(type_name) if explicit else self


class ExpressionWriter:
    """Expressions of one function.

    Args:
        runtime: collects the names of the operations that C needs.
    """

    def __init__(
        self,
        kernel: Kernel,
        facts: Facts,
        function: Function,
        found: FunctionFacts,
        runtime: set[str],
    ) -> None:
        self._kernel = kernel
        self._facts = facts
        self._function = function
        self._found = found
        self._runtime = runtime

    def _refuse(self, node: ast.AST, reason: str) -> Untranslatable:
        return Untranslatable(self._function.path, node, reason)

    def _kind(self, node: ast.expr) -> Scalar:
        kind = self._facts.nodes.get(node)
        if kind is None:
            raise self._refuse(node, "is never reached")
        return kind

    def expression(self, node: ast.expr, store: bool = False) -> CText:
        """C text of an expression; `store` for the target of an assignment."""
        match node:
            case ast.Constant(value=int() | float() as value):
                return CText(c_number(value), _ATOM, c_type(self._kind(node)))
            case ast.Attribute():
                return self._attribute(node)
            case ast.Name(id=name):
                if name in self._found.scalars:
                    return CText(name, _ATOM, c_type(self._found.scalars[name]))
                return CText(name, _ATOM, c_type(self._kind(node)))
            case ast.Subscript(value=array, slice=index):
                return self._element(node, array, index, store)
            case ast.UnaryOp(op=operator, operand=operand):
                return self._unary(node, operator, self.expression(operand))
            case ast.BinOp(left=left, op=ast.LShift(), right=right):
                return self._scaled(node, left, right)
            case ast.BinOp(left=left, op=ast.RShift(), right=right):
                return self._shifted(node, left, right)
            case ast.BinOp(left=left, op=operator, right=right):
                return self._binary(node, self.expression(left), operator, self.expression(right))
            case ast.IfExp(test=test, body=body, orelse=orelse):
                a, b = self.expression(body), self.expression(orelse)
                type_name = DOUBLE if DOUBLE in (a.type, b.type) else max(a.type, b.type)
                choice = f"({self.test(test)} ? {a.at(_SUM)} : {b.at(_SUM)})"
                return CText(choice, _ATOM, type_name)
            case ast.Call():
                return self.call(node)
        raise self._refuse(node, f"{type(node).__name__} is outside the subset")

    def _element(self, node: ast.Subscript, array: ast.expr, index: ast.expr, store: bool) -> CText:
        name = self._array(array)
        if isinstance(array, ast.Attribute):
            array_type = self.expression(array).type
        elif name in self._found.arrays:
            array_type = element_type(self._found.arrays[name])
        else:
            self._facts.constants.add(name)
            array_type = c_type(self._kind(node)) if not store else INT32
        if isinstance(index, ast.Constant):
            return CText(f"{name}[{index.value!r}]", _ATOM, array_type)
        return CText(f"{name}[{self.expression(index).text}]", _ATOM, array_type)

    def _attribute(self, node: ast.Attribute) -> CText:
        """A field of a record, or pi."""
        owner = node.value.id if isinstance(node.value, ast.Name) else ""
        if owner not in self._found.structures:
            return CText(c_number(math.pi), _ATOM, DOUBLE)
        number = self._found.structures[owner].members[node.attr]
        return CText(f"{owner}->{node.attr}", _ATOM, element_type(number))

    def _array(self, node: ast.expr) -> str:
        """C text of an array: a variable or the vector of a record."""
        return node.id if isinstance(node, ast.Name) else self.expression(node).text

    def _result(self, node: ast.expr, text: CText) -> CText:
        """`text` narrowed to 32 bits where its range is proved to fit."""
        kind = self._kind(node)
        narrow = text.type == INT64 and isinstance(kind, Interval) and kind.fits(32)
        return text.cast(INT32) if narrow else text

    def _unary(self, node: ast.expr, operator: ast.unaryop, value: CText) -> CText:
        sign = "-" if isinstance(operator, ast.USub) else "~"
        wide = value.cast(c_type(self._kind(node))) if value.type == INT32 else value
        text = wide.at(_ATOM)
        return self._result(node, CText(f"{sign}{text}", _UNARY, wide.type))

    def _scaled(self, node: ast.expr, left: ast.expr, right: ast.expr) -> CText:
        """A shift to the left, written as the product that it is."""
        value, n = self.expression(left), self._kind(right)
        assert isinstance(n, Interval)
        if n.lo == n.hi:
            factor = CText(c_number(1 << n.lo), _ATOM, INT32 if n.lo < 31 else INT64)
        else:
            count = self.expression(right).at(_ATOM)
            factor = CText(f"(INT32_C(1) << {count})", _ATOM, INT32)
        return self._binary(node, value, ast.Mult(), factor)

    def _shifted(self, node: ast.expr, left: ast.expr, right: ast.expr) -> CText:
        value, kind = self.expression(left), self._kind(left)
        n = self._kind(right)
        assert isinstance(kind, Interval)
        assert isinstance(n, Interval)
        count = str(n.lo) if n.lo == n.hi else self.expression(right).at(_ATOM)
        if kind.lo >= 0:
            return self._result(node, CText(f"{value.at(_ATOM)} >> {count}", _OTHER, value.type))
        name = f"shift_right_{64 if value.type == INT64 else 32}"
        self._runtime.add(name)
        return self._result(node, CText(f"{name}({value.text}, {count})", _ATOM, value.type))

    def _binary(self, node: ast.expr, a: CText, operator: ast.operator, b: CText) -> CText:
        sign, level = _OPERATORS[type(operator)]
        kind = self._kind(node)
        if isinstance(kind, Float):
            a, b = a.cast(DOUBLE), b.cast(DOUBLE)
            type_name = DOUBLE
        else:
            type_name = max(a.type, b.type, c_type(kind))
            a = a.cast(type_name)
        if level == _OTHER:
            text = f"{a.at(_UNARY)} {sign} {b.at(_UNARY)}"
        else:
            text = f"{a.at(level)} {sign} {b.at(level + 1)}"
        return self._result(node, CText(text, level, type_name))

    def call(self, node: ast.Call) -> CText:
        """C text of a call, of the runtime or of another kernel function."""
        match node.func:
            case ast.Attribute(attr=name):
                arguments = ", ".join(self.expression(value).text for value in node.args)
                return CText(f"{name}({arguments})", _ATOM, DOUBLE)
            case ast.Name(id="float"):
                return self.expression(node.args[0]).cast(DOUBLE)
            case ast.Name(id="abs"):
                value = self.expression(node.args[0])
                if not isinstance(self._kind(node), Interval) or value.type == INT32:
                    value = value.cast(c_type(self._kind(node)))
                name = f"magnitude_{64 if value.type == INT64 else 32}"
                self._runtime.add(name)
                return self._result(node, CText(f"{name}({value.text})", _ATOM, value.type))
            case ast.Name(id="clamp"):
                return self._clamp(node)
            case ast.Name(id="known"):
                return self._result(node, self.expression(node.args[0]))
            case ast.Name(id=name):
                return self._kernel_call(node, name)
        raise self._refuse(node, "call outside the subset")

    def _clamp(self, node: ast.Call) -> CText:
        x, low, high = (self.expression(part) for part in node.args)
        kinds = [self._kind(part) for part in node.args]
        ranges = [kind for kind in kinds if isinstance(kind, Interval)]
        differences = [subtract(ranges[0], ranges[2]), subtract(ranges[0], ranges[1])]
        narrow = x.type == INT32 and all(difference.fits(32) for difference in differences)
        bits = 32 if narrow and max(low.type, high.type) == INT32 else 64
        if ranges[0].lo >= ranges[1].hi:
            name, limits = f"at_most_{bits}", high.text
        elif ranges[0].hi <= ranges[2].lo:
            name, limits = f"at_least_{bits}", low.text
        else:
            name, limits = f"clamp_{bits}", f"{low.text}, {high.text}"
        self._runtime.add(name)
        text = f"{name}({x.text}, {limits})"
        return self._result(node, CText(text, _ATOM, f"int{bits}_t"))

    def _kernel_call(self, node: ast.Call, name: str) -> CText:
        callee = self._facts.functions[name]
        arguments = []
        parameters = self._kernel.functions[name].node.args.args
        for parameter, value in zip(parameters, node.args, strict=True):
            if parameter.arg in callee.arrays or parameter.arg in callee.structures:
                arguments.append(self._array(value))
            else:
                wanted = c_type(callee.scalars[parameter.arg])
                arguments.append(self.expression(value).widened(wanted).text)
        type_name = "void" if callee.result is None else c_type(callee.result)
        text = CText(f"{name}({', '.join(arguments)})", _ATOM, type_name)
        return text if callee.result is None else self._result(node, text)

    def test(self, node: ast.expr) -> str:
        """C text of a condition."""
        match node:
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"!({self.test(operand)})"
            case ast.BoolOp(op=junction, values=values):
                word = " && " if isinstance(junction, ast.And) else " || "
                parts = (self.test(value) for value in values)
                return word.join(f"({p})" if "&&" in p or "||" in p else p for p in parts)
            case ast.Compare(left=left, ops=operators, comparators=operands):
                terms = []
                for operator, right in zip(operators, operands, strict=True):
                    a, b = self.expression(left), self.expression(right)
                    if DOUBLE in (a.type, b.type):
                        a, b = a.cast(DOUBLE), b.cast(DOUBLE)
                    terms.append(f"{a.at(_SUM)} {_COMPARISONS[type(operator)]} {b.at(_SUM)}")
                    left = right
                return " && ".join(terms)
        raise self._refuse(node, "a test is a comparison, or comparisons joined by and, or, not")


def element_type(array: Array) -> str:
    """The C type of an array's elements."""
    return DOUBLE if array.is_float else INT32
