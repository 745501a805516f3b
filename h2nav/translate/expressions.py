"""Kind and range of an expression; comparisons narrow the ranges of their operands."""

import ast
from collections.abc import Callable

from h2nav.translate import intervals
from h2nav.translate.facts import (
    FLOAT,
    Array,
    Facts,
    Float,
    Scalar,
    ScopeState,
    Structure,
    join_scalars,
    join_states,
)
from h2nav.translate.intervals import INT32, INT64, Interval
from h2nav.translate.source import Kernel, Untranslatable

FLOAT_FUNCTIONS = {
    "sqrt": 1,
    "sin": 1,
    "cos": 1,
    "tan": 1,
    "fabs": 1,
    "atan2": 2,
    "asin": 1,
    "exp": 1,
    "log": 1,
}
_INTEGER_OPERATIONS: dict[type[ast.operator], Callable[[Interval, Interval], Interval]] = {
    ast.Add: intervals.add,
    ast.Sub: intervals.subtract,
    ast.Mult: intervals.multiply,
    ast.BitAnd: intervals.bit_and,
    ast.BitOr: intervals.bit_or,
    ast.BitXor: intervals.bit_xor,
}
_FLOAT_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_OPPOSITE: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}
_MIRROR: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt,
    ast.Gt: ast.Lt,
    ast.LtE: ast.GtE,
    ast.GtE: ast.LtE,
    ast.Eq: ast.Eq,
    ast.NotEq: ast.NotEq,
}

# Calls a kernel function: (place, name, argument expressions, state) -> result.
Caller = Callable[[ast.Call, str, ScopeState], "Scalar | None"]


class Expressions:
    """Evaluates the expressions of one function call.

    Args:
        facts: collects the hull of every expression.
        path: file of the function, for refusals.
        structures: its arguments that are records.
        call: runs a call of another kernel function.
    """

    def __init__(
        self,
        kernel: Kernel,
        facts: Facts,
        path: str,
        arrays: dict[str, Array],
        structures: dict[str, Structure],
        call: Caller,
    ) -> None:
        self._kernel = kernel
        self._facts = facts
        self._path = path
        self._arrays = arrays
        self._structures = structures
        self._call = call

    def refuse(self, node: ast.AST, reason: str) -> Untranslatable:
        """The refusal of `node`, to be raised."""
        return Untranslatable(self._path, node, reason)

    def scalar(self, node: ast.expr, state: ScopeState) -> Scalar:
        """Kind and range of `node`; integers must fit 64 bits.

        Raises:
            Untranslatable: outside the subset, unset, or wider than 64 bits.
        """
        value = self._evaluate(node, state)
        if isinstance(value, Interval) and not value.within(INT64):
            raise self.refuse(node, f"may need {value.bits} bits (reaches {value.lo}..{value.hi})")
        known = self._facts.nodes.get(node)
        joined = value if known is None else join_scalars(known, value)
        if joined is None:
            raise self.refuse(node, "is sometimes an integer, sometimes a float")
        self._facts.nodes[node] = joined
        return value

    def integer(self, node: ast.expr, state: ScopeState) -> Interval:
        """Range of an expression that must be an integer."""
        value = self.scalar(node, state)
        if isinstance(value, Float):
            raise self.refuse(node, "an integer is needed here")
        return value

    def exact(self, node: ast.expr, value: Scalar) -> None:
        """Refuses an integer that a double does not hold exactly."""
        if isinstance(value, Interval) and not value.fits(54):
            raise self.refuse(node, "too wide to become a float exactly")

    def _evaluate(self, node: ast.expr, state: ScopeState) -> Scalar:
        match node:
            case ast.Constant(value=bool()):
                raise self.refuse(node, "truth values are not numbers")
            case ast.Constant(value=int() as value):
                return intervals.exactly(value)
            case ast.Constant(value=float()):
                return FLOAT
            case ast.Attribute(value=ast.Name(id="math"), attr="pi"):
                return FLOAT
            case ast.Name(id=name):
                return self._name(node, name, state)
            case ast.Attribute():
                array = self.number_at(node)
                return FLOAT if array.is_float else state.cells[array.key].get(0, INT32)
            case ast.Subscript():
                return self._element(node, state)
            case ast.UnaryOp(op=operator, operand=operand):
                return self._unary(node, operator, operand, state)
            case ast.BinOp(left=left, op=operator, right=right):
                return self._binary(node, left, operator, right, state)
            case ast.IfExp(test=test, body=body, orelse=orelse):
                return self._choice(node, test, body, orelse, state)
            case ast.Call():
                return self._called(node, state)
        raise self.refuse(node, f"{type(node).__name__} is outside the subset")

    def _name(self, node: ast.expr, name: str, state: ScopeState) -> Scalar:
        if name in state.scalars:
            return state.scalars[name]
        constant = self._kernel.constants.get(name)
        if constant is None or isinstance(constant.value, tuple):
            raise self.refuse(node, f"{name} is not a number that is set on every path to here")
        self._facts.constants.add(name)
        return FLOAT if isinstance(constant.value, float) else intervals.exactly(constant.value)

    def array_at(self, node: ast.expr) -> Array | None:
        """The array that `node` names: a variable, or the vector of a record; None for others."""
        match node:
            case ast.Name(id=name):
                return self._arrays.get(name)
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if name in self._structures:
                structure = self._structures[name]
                return None if attribute in structure.numbers else self._member(node, structure)
        return None

    def number_at(self, node: ast.Attribute) -> Array:
        """The single number of a record that `node` names, as an array of one element."""
        match node:
            case ast.Attribute(value=ast.Name(id=name), attr=attribute) if name in self._structures:
                structure = self._structures[name]
                if attribute in structure.numbers:
                    return structure.members[attribute]
                self._member(node, structure)
                raise self.refuse(node, f"{attribute} is a vector, a number is needed here")
        raise self.refuse(node, f"{ast.unparse(node)} is not a field of a record")

    def _member(self, node: ast.Attribute, structure: Structure) -> Array:
        if node.attr not in structure.members:
            raise self.refuse(node, f"{structure.type_name} has no field {node.attr}")
        return structure.members[node.attr]

    def element_of(self, node: ast.Subscript, state: ScopeState) -> tuple[Array, Interval]:
        """The array that `node` subscripts and the range of the index, which must lie inside."""
        array = self.array_at(node.value)
        if array is None:
            raise self.refuse(node, "only arrays may be subscripted")
        if array.key not in state.cells:
            raise self.refuse(node, f"{ast.unparse(node.value)} is not set on every path to here")
        index = self.integer(node.slice, state)
        limit = INT32.hi if array.length is None else array.length - 1
        if index.lo < 0 or index.hi > limit:
            raise self.refuse(node, f"index {index.lo}..{index.hi} leaves 0..{limit}")
        return array, index

    def _element(self, node: ast.Subscript, state: ScopeState) -> Scalar:
        array, index = self.element_of(node, state)
        if array.is_float:
            return FLOAT
        cells = state.cells[array.key]
        if array.length is None and index.lo != index.hi:
            return INT32
        hull = cells.get(index.lo, INT32)
        for i in range(index.lo + 1, index.hi + 1):
            hull = hull.hull(cells.get(i, INT32))
        return hull

    def _unary(
        self, node: ast.expr, operator: ast.unaryop, operand: ast.expr, state: ScopeState
    ) -> Scalar:
        value = self.scalar(operand, state)
        if isinstance(operator, ast.USub):
            return FLOAT if isinstance(value, Float) else intervals.negate(value)
        if isinstance(operator, ast.Invert) and isinstance(value, Interval):
            return intervals.invert(value)
        raise self.refuse(node, f"{type(operator).__name__} is outside the subset here")

    def _binary(
        self,
        node: ast.expr,
        left: ast.expr,
        operator: ast.operator,
        right: ast.expr,
        state: ScopeState,
    ) -> Scalar:
        a, b = self.scalar(left, state), self.scalar(right, state)
        if isinstance(a, Float) or isinstance(b, Float):
            if isinstance(operator, _FLOAT_OPERATORS):
                self.exact(left, a)
                self.exact(right, b)
                return FLOAT
            raise self.refuse(node, f"{type(operator).__name__} is outside the subset of floats")
        if isinstance(operator, ast.LShift | ast.RShift):
            return self._shifted(node, a, operator, b)
        operation = _INTEGER_OPERATIONS.get(type(operator))
        if operation is None:
            raise self.refuse(node, f"{type(operator).__name__} is outside the subset of integers")
        if isinstance(operator, ast.Mult) and a == b and ast.dump(left) == ast.dump(right):
            return intervals.square(a)  # the ranges are compared first because a dump costs more
        return operation(a, b)

    def _shifted(
        self, node: ast.expr, a: Interval, operator: ast.operator, n: Interval
    ) -> Interval:
        if isinstance(operator, ast.LShift):
            if n.lo < 0 or n.hi > (30 if n.lo != n.hi else 62):
                raise self.refuse(node, f"shift by {n.lo}..{n.hi}")
            return intervals.shift_left(a, n)
        if n.lo < 0 or n.hi > (31 if a.fits(32) else 63):
            raise self.refuse(node, f"shift of a {a.bits}-bit value by {n.lo}..{n.hi}")
        return intervals.shift_right(a, n)

    def _choice(
        self, node: ast.expr, test: ast.expr, body: ast.expr, orelse: ast.expr, state: ScopeState
    ) -> Scalar:
        paths = [
            (branch, narrowed)
            for branch, truth in ((body, True), (orelse, False))
            if (narrowed := self.narrow(test, state.copy(), truth)) is not None
        ]
        values = [self.scalar(branch, narrowed) for branch, narrowed in paths]
        after = join_states(paths[0][1], paths[-1][1])
        assert after is not None
        state.cells = after.cells
        joined = values[0] if len(values) == 1 else join_scalars(values[0], values[1])
        if joined is None:
            raise self.refuse(node, "is sometimes an integer, sometimes a float")
        for branch in (body, orelse):  # a branch that is never taken still needs a type
            self._facts.nodes.setdefault(branch, joined)
        return joined

    def _called(self, node: ast.Call, state: ScopeState) -> Scalar:
        match node:
            case ast.Call(keywords=[_, *_]):
                raise self.refuse(node, "keyword arguments are outside the subset")
            case ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name)):
                return self._float_call(node, name, state)
            case ast.Call(func=ast.Name(id="float"), args=[value]):
                self.scalar(value, state)
                return FLOAT
            case ast.Call(func=ast.Name(id="abs"), args=[value]):
                return intervals.magnitude(self.integer(value, state))
            case ast.Call(func=ast.Name(id="clamp"), args=[value, lo, hi]):
                return self._clamped(node, value, lo, hi, state)
            case ast.Call(func=ast.Name(id="known"), args=[value, lo, hi]):
                return self._clamped(node, value, lo, hi, state)
            case ast.Call(func=ast.Name(id=name)) if name in self._kernel.functions:
                result = self._call(node, name, state)
                if result is None:
                    raise self.refuse(node, f"{name} returns nothing")
                return result
        raise self.refuse(node, f"call of {ast.unparse(node.func)} is outside the subset")

    def _float_call(self, node: ast.Call, name: str, state: ScopeState) -> Scalar:
        if FLOAT_FUNCTIONS.get(name) != len(node.args):
            raise self.refuse(node, f"math.{name} with {len(node.args)} arguments is not known")
        if any(isinstance(self.scalar(value, state), Interval) for value in node.args):
            raise self.refuse(node, f"math.{name} of an integer")
        return FLOAT

    def _clamped(
        self, node: ast.Call, value: ast.expr, lo: ast.expr, hi: ast.expr, state: ScopeState
    ) -> Interval:
        x, low, high = (self.integer(part, state) for part in (value, lo, hi))
        if low.hi > high.lo:
            raise self.refuse(node, "clamp: the lower limit may lie above the upper")
        return intervals.clamp(x, low, high)

    def narrow(self, test: ast.expr, state: ScopeState, truth: bool) -> ScopeState | None:
        """The state in which `test` has the given truth; None when it never has."""
        match test:
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return self.narrow(operand, state, not truth)
            case ast.BoolOp(op=operator, values=[first, *rest]):
                remaining = rest[0] if len(rest) == 1 else ast.BoolOp(operator, rest)
                if isinstance(operator, ast.And) == truth:
                    partly = self.narrow(first, state, truth)
                    return None if partly is None else self.narrow(remaining, partly, truth)
                short = self.narrow(first, state.copy(), truth)
                other = self.narrow(first, state, not truth)
                late = None if other is None else self.narrow(remaining, other, truth)
                return join_states(short, late)
            case ast.Compare(left=left, ops=operators, comparators=operands):
                return self._compared(test, left, operators, operands, state, truth=truth)
        raise self.refuse(test, "a test is a comparison, or comparisons joined by and, or, not")

    def _compared(
        self,
        test: ast.expr,
        left: ast.expr,
        operators: list[ast.cmpop],
        operands: list[ast.expr],
        state: ScopeState,
        *,
        truth: bool,
    ) -> ScopeState | None:
        narrowed: ScopeState | None = state
        if any(isinstance(part, ast.Call) for one in operands[:-1] for part in ast.walk(one)):
            raise self.refuse(test, "a call between two comparisons, which C makes twice")
        for operator, right in zip(operators, operands, strict=True):
            if type(operator) not in _MIRROR:
                raise self.refuse(test, f"{type(operator).__name__} is outside the subset")
            a, b = self.scalar(left, state), self.scalar(right, state)
            if isinstance(a, Float) or isinstance(b, Float):
                self.exact(left, a)
                self.exact(right, b)
            elif (truth or len(operators) == 1) and not self._calls(test):
                relation = type(operator) if truth else _OPPOSITE[type(operator)]
                narrowed = self._restrict(narrowed, left, a, relation, b)
                narrowed = self._restrict(narrowed, right, b, _MIRROR[relation], a)
            left = right
        return narrowed

    def _calls(self, test: ast.expr) -> bool:
        """Whether a kernel function is called, which may write what it is compared with."""
        calls = (part.func for part in ast.walk(test) if isinstance(part, ast.Call))
        return any(isinstance(f, ast.Name) and f.id in self._kernel.functions for f in calls)

    def _restrict(
        self,
        state: ScopeState | None,
        node: ast.expr,
        value: Interval,
        relation: type[ast.cmpop],
        bound: Interval,
    ) -> ScopeState | None:
        """`state` with the variable `node` limited to what stands in `relation` to `bound`."""
        if state is None:
            return None
        lo, hi = value
        if relation in (ast.Lt, ast.LtE, ast.Eq):
            hi = min(hi, bound.hi - (relation is ast.Lt))
        if relation in (ast.Gt, ast.GtE, ast.Eq):
            lo = max(lo, bound.lo + (relation is ast.Gt))
        if relation is ast.NotEq and bound.lo == bound.hi:
            lo, hi = lo + (lo == bound.lo), hi - (hi == bound.lo)
        if lo > hi:
            return None
        if isinstance(node, ast.Name) and node.id in state.scalars:
            state = state.copy()
            state.scalars[node.id] = Interval(lo, hi)
        elif isinstance(node, ast.Attribute):
            state = state.copy()
            state.put(self.number_at(node).key, 0, Interval(lo, hi))
        elif isinstance(node, ast.Subscript):
            array, index = self.element_of(node, state)
            if index.lo == index.hi and not array.is_float:
                state = state.copy()
                state.put(array.key, index.lo, Interval(lo, hi))
        return state
