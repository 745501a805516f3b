"""Runs a kernel on intervals, over every path, loop pass and call, to prove its ranges.

Loops have constant bounds and are run pass by pass; functions are run again for each call; at a
join the hull of both paths holds. Records in the arguments start inside their declared ranges, and
every entry point must leave them inside: so the declaration is an invariant of any sequence of
calls, proved by induction.
"""

import ast
from collections.abc import Mapping, Sequence

from h2nav.translate import intervals
from h2nav.translate.expressions import Expressions
from h2nav.translate.facts import (
    FLOAT,
    Array,
    Facts,
    Float,
    FunctionFacts,
    Scalar,
    ScopeState,
    Structure,
    join_scalars,
    join_states,
)
from h2nav.translate.intervals import INT16, INT32, INT64, UINT16, Interval
from h2nav.translate.source import Function, Kernel, RecordSource, Untranslatable

_ANNOTATED = {"int": INT32, "I16": INT16, "U16": UINT16, "I32": INT32, "I64": INT64}
_LOOP_LIMIT = 4096

Argument = Scalar | Array | Structure


def analyse(kernel: Kernel, entries: Sequence[str], initialisers: Sequence[str] = ()) -> Facts:
    """Runs every entry point from all possible inputs.

    Args:
        entries: functions that find and leave every record inside its declared ranges.
        initialisers: functions that find a first argument of zeros, and leave it in its ranges.

    Raises:
        Untranslatable: outside the subset, wider than 64 bits, or a declared range is left.
    """
    analysis = _Analysis(kernel)
    for name in (*initialisers, *entries):
        analysis.run_entry(kernel.functions[name], begins=name in initialisers)
    return analysis.facts


class _Analysis:
    def __init__(self, kernel: Kernel) -> None:
        self.facts = Facts()
        self._kernel = kernel
        self._calls: list[str] = []
        self._arrays = 0
        self._tables: dict[str, tuple[Array, dict[int, Interval]]] = {}
        for name, constant in kernel.constants.items():
            if isinstance(constant.value, tuple) and constant.value:
                self._add_table(name, constant.value)

    def _add_table(self, name: str, values: tuple[object, ...]) -> None:
        cells = {i: intervals.exactly(v) for i, v in enumerate(values) if isinstance(v, int)}
        if len(cells) == len(values) and all(cell.within(INT32) for cell in cells.values()):
            array = self.new_array(is_float=False, length=len(values), writable=False)
            self._tables[name] = (array, cells)
        elif all(isinstance(value, float) for value in values):
            array = self.new_array(is_float=True, length=len(values), writable=False)
            self._tables[name] = (array, {})

    def new_array(self, is_float: bool, length: int | None, writable: bool = True) -> Array:
        self._arrays += 1
        return Array(self._arrays, is_float, length, writable)

    def run_entry(self, function: Function, begins: bool) -> None:
        state = ScopeState(cells={array.key: cells for array, cells in self._tables.values()})
        arguments: dict[str, Argument] = {}
        for number, argument in enumerate(function.node.args.args):
            kind = _annotation(self._kernel, function, argument)
            if isinstance(kind, RecordSource):
                is_zero = begins and number == 0
                arguments[argument.arg] = self._new_structure(kind, state, is_zero=is_zero)
            elif isinstance(kind, bool):
                array = self.new_array(kind, None)
                state.cells[array.key] = {}
                arguments[argument.arg] = array
            else:
                arguments[argument.arg] = kind
        _, after = self.run(function, arguments, state)
        for name, value in arguments.items():
            if isinstance(value, Structure) and after is not None:
                self._check_declared(function, name, value, after)

    def _new_structure(self, record: RecordSource, state: ScopeState, is_zero: bool) -> Structure:
        """A record in memory: of zeros, or anywhere in its declared ranges."""
        members = {}
        for row in record.rows:
            members[row.name] = array = self.new_array(row.range is None, row.length)
            found = intervals.exactly(0) if is_zero else Interval(*(row.range or INT32))
            state.cells[array.key] = dict.fromkeys(range(row.length), found)
        numbers = frozenset(row.name for row in record.rows if row.size is None)
        return Structure(record.name, members, numbers)

    def _check_declared(
        self, function: Function, name: str, structure: Structure, after: ScopeState
    ) -> None:
        for row in self._kernel.records[structure.type_name].rows:
            if row.range is None:
                continue
            allowed, cells = Interval(*row.range), after.cells[structure.members[row.name].key]
            for i in range(row.length):
                reached = cells.get(i, INT32)
                if not reached.within(allowed):
                    place = row.name if row.size is None else f"{row.name}[{i}]"
                    raise Untranslatable(
                        function.path,
                        function.node,
                        f"{function.name} may leave {name}.{place} at {reached.lo}..{reached.hi}, "
                        f"declared {allowed.lo}..{allowed.hi}",
                    )

    def run(
        self, function: Function, arguments: Mapping[str, Argument], state: ScopeState
    ) -> tuple[Scalar | None, ScopeState | None]:
        """Runs one call; returns what it returns and the state of the arrays afterwards."""
        if function.name in self._calls:
            raise Untranslatable(function.path, function.node, f"{function.name} calls itself")
        self._calls.append(function.name)
        frame = _Frame(self, self._kernel, function, arguments, self._tables)
        result = frame.run(ScopeState({}, state.cells))
        self._calls.pop()
        return result

    def remember(self, function: Function, found: FunctionFacts) -> None:
        """Joins the result of one call with those of earlier calls."""
        known = self.facts.functions.setdefault(function.name, FunctionFacts())
        for name, scalar in found.scalars.items():
            joined = join_scalars(known.scalars.get(name, scalar), scalar)
            if joined is None:
                reason = f"{name} is sometimes an integer, sometimes a float"
                raise Untranslatable(function.path, function.node, reason)
            known.scalars[name] = joined
        known.arrays.update(found.arrays)
        known.structures.update(found.structures)
        if found.result is not None:
            known.returns(found.result)


class _Frame:
    """One call of one function."""

    def __init__(
        self,
        analysis: _Analysis,
        kernel: Kernel,
        function: Function,
        arguments: Mapping[str, Argument],
        tables: dict[str, tuple[Array, dict[int, Interval]]],
    ) -> None:
        self._analysis = analysis
        self._kernel = kernel
        self._function = function
        self._found = FunctionFacts()
        self._arrays = {name: array for name, (array, _) in tables.items()}
        self._scalars: dict[str, Scalar] = {}
        self._loops: list[str] = []  # variables of the loops around the present statement
        for name, value in arguments.items():
            if isinstance(value, Array):
                self._arrays[name] = self._found.arrays[name] = value
            elif isinstance(value, Structure):
                self._found.structures[name] = value
            else:
                self._scalars[name] = self._found.scalars[name] = value
        self._expressions = Expressions(
            kernel,
            analysis.facts,
            function.path,
            self._arrays,
            self._found.structures,
            self._call,
        )
        self._returned: ScopeState | None = None

    def run(self, state: ScopeState) -> tuple[Scalar | None, ScopeState | None]:
        state.scalars = dict(self._scalars)
        end = self._block(self._function.node.body, state)
        returns = self._function.node.returns
        gives = not (isinstance(returns, ast.Constant) and returns.value is None)
        if end is not None and (gives or self._found.result is not None):
            raise self._refuse(self._function.node, "may end without returning a value")
        self._analysis.remember(self._function, self._found)
        return self._found.result, join_states(self._returned, end)

    def _refuse(self, node: ast.AST, reason: str) -> Untranslatable:
        return Untranslatable(self._function.path, node, reason)

    def _block(self, body: Sequence[ast.stmt], state: ScopeState | None) -> ScopeState | None:
        for statement in body:
            if state is None:
                break  # another call may reach the rest; the writer refuses what none does
            state = self._statement(statement, state)
        return state

    def _statement(self, node: ast.stmt, state: ScopeState) -> ScopeState | None:
        match node:
            case ast.Assign(targets=[target], value=value):
                self._assign(target, value, state)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self._assign(target, value, state)
            case ast.AugAssign(target=target, op=operator, value=value):
                self._assign(target, joined_operation(node, target, operator, value), state)
            case ast.If():
                return self._if(node, state)
            case ast.For():
                return self._for(node, state)
            case ast.Return(value=value):
                self._return(value, state)
                return None
            case ast.Expr(value=ast.Constant(value=str())) | ast.Pass():
                pass
            case ast.Expr(value=ast.Call(func=ast.Name(id=name)) as call):
                if name not in self._kernel.functions:
                    raise self._refuse(node, f"call of {name} is outside the subset")
                result = self._call(call, name, state)
                if result is not None:  # it is left, but has a type
                    self._analysis.facts.nodes.setdefault(call, result)
            case _:
                raise self._refuse(node, f"{type(node).__name__} is outside the subset")
        return state

    def _assign(self, target: ast.expr, value: ast.expr, state: ScopeState) -> None:
        if isinstance(target, ast.Name):
            elements = list_elements(value)
            if elements is not None:
                self._new_list(target, elements, state)
                return
            if target.id in self._arrays or target.id in self._kernel.constants:
                raise self._refuse(target, f"{target.id} already names something else")
            if target.id in self._loops:
                raise self._refuse(target, f"{target.id} is the variable of a loop")
            scalar = self._expressions.scalar(value, state)
            state.scalars[target.id] = scalar
            known = self._found.scalars.get(target.id, scalar)
            joined = join_scalars(known, scalar)
            if joined is None:
                raise self._refuse(target, "is sometimes an integer, sometimes a float")
            self._found.scalars[target.id] = joined
        elif isinstance(target, ast.Subscript | ast.Attribute):
            self._store(target, self._expressions.scalar(value, state), state)
        else:
            raise self._refuse(target, "only names, elements and fields may be assigned")

    def _new_list(self, target: ast.Name, elements: list[ast.expr], state: ScopeState) -> None:
        values = [self._expressions.scalar(element, state) for element in elements]
        is_float = any(isinstance(value, Float) for value in values)
        known = self._found.arrays.get(target.id)
        if known is not None and (known.is_float, known.length) != (is_float, len(values)):
            raise self._refuse(target, f"{target.id} changes its kind or length")
        array = known or self._analysis.new_array(is_float, len(values))
        self._arrays[target.id] = self._found.arrays[target.id] = array
        if is_float and any(isinstance(value, Interval) for value in values):
            raise self._refuse(target, "mixes integers and floats")
        cells = {i: value for i, value in enumerate(values) if isinstance(value, Interval)}
        if any(not value.within(INT32) for value in cells.values()):
            raise self._refuse(target, "an array of integers holds 32-bit values")
        state.cells[array.key] = cells

    def _store(
        self, target: ast.Subscript | ast.Attribute, value: Scalar, state: ScopeState
    ) -> None:
        if isinstance(target, ast.Attribute):
            array, index = self._expressions.number_at(target), intervals.exactly(0)
        else:
            array, index = self._expressions.element_of(target, state)
        if not array.writable:
            raise self._refuse(target, "a constant table is written")
        if array.is_float:
            self._expressions.exact(target, value)
            return
        if isinstance(value, Float):
            raise self._refuse(target, "a float is stored in an array of integers")
        if not value.within(INT32):
            raise self._refuse(target, f"stores {value.lo}..{value.hi} in a 32-bit element")
        if index.lo == index.hi:
            state.put(array.key, index.lo, value)
        else:
            cells = state.cells[array.key]
            reached = range(index.lo, index.hi + 1)
            hulls = {i: cells.get(i, INT32).hull(value) for i in reached}
            state.cells[array.key] = {**cells, **hulls}

    def _if(self, node: ast.If, state: ScopeState) -> ScopeState | None:
        # A function that the test calls writes once on either path.
        taken = self._expressions.narrow(node.test, state.copy(), True)
        other = self._expressions.narrow(node.test, state.copy(), False)
        return join_states(self._block(node.body, taken), self._block(node.orelse, other))

    def _for(self, node: ast.For, state: ScopeState) -> ScopeState | None:
        match node:
            case ast.For(
                target=ast.Name(id=name),
                iter=ast.Call(func=ast.Name(id="range"), args=[*bounds], keywords=[]),
                orelse=[],
            ) if 1 <= len(bounds) <= 2:
                ends = [self._expressions.integer(bound, state) for bound in bounds]
            case _:
                raise self._refuse(node, "a loop runs over range(constant)")
        if any(end.lo != end.hi for end in ends):
            raise self._refuse(node, "the bounds of a loop are constant")
        start, stop = (0, ends[0].lo) if len(ends) == 1 else (ends[0].lo, ends[1].lo)
        if stop - start > _LOOP_LIMIT:
            raise self._refuse(node, f"more than {_LOOP_LIMIT} passes")
        names, keys = set(state.scalars), set(state.cells)
        after: ScopeState | None = state
        self._loops.append(name)
        for i in range(start, stop):
            if after is None:
                break
            # In C what only the body mentions is declared inside it, anew in each pass.
            after.scalars = {n: v for n, v in after.scalars.items() if n in names}
            for array in self._found.arrays.values():
                if array.key not in keys:
                    after.cells.pop(array.key, None)
            after.scalars[name] = intervals.exactly(i)
            hull = self._found.scalars.get(name, intervals.exactly(i))
            assert isinstance(hull, Interval)
            # the C loop variable also reaches the bound
            self._found.scalars[name] = hull.hull(Interval(i, i + 1))
            after = self._block(node.body, after)
        self._loops.pop()
        if after is not None:
            after.scalars.pop(name, None)
        return after

    def _return(self, value: ast.expr | None, state: ScopeState) -> None:
        if value is not None and not (isinstance(value, ast.Constant) and value.value is None):
            scalar = self._expressions.scalar(value, state)
            if not self._found.returns(scalar):
                raise self._refuse(value, "returns sometimes an integer, sometimes a float")
        self._returned = join_states(self._returned, state)

    def _call(self, node: ast.Call, name: str, state: ScopeState) -> Scalar | None:
        function = self._kernel.functions[name]
        parameters = function.node.args.args
        if len(parameters) != len(node.args) or node.keywords:
            raise self._refuse(node, f"{name} takes {len(parameters)} plain arguments")
        arguments: dict[str, Argument] = {}
        for parameter, value in zip(parameters, node.args, strict=True):
            kind = _annotation(self._kernel, function, parameter)
            if isinstance(kind, RecordSource):
                arguments[parameter.arg] = self._structure(value, kind, name)
                continue
            if isinstance(kind, bool):
                array = self._expressions.array_at(value)
                if array is None or array.is_float != kind or array.key not in state.cells:
                    raise self._refuse(value, f"{name} needs an array for {parameter.arg}")
                arguments[parameter.arg] = array
                continue
            scalar = self._expressions.scalar(value, state)
            if isinstance(scalar, Float) != isinstance(kind, Float):
                raise self._refuse(value, f"wrong kind of number for {parameter.arg} of {name}")
            if (
                isinstance(scalar, Interval)
                and isinstance(kind, Interval)
                and not (scalar.within(kind))
            ):
                reason = f"{parameter.arg} of {name} may be {scalar.lo}..{scalar.hi}"
                raise self._refuse(value, f"{reason}, outside its annotation")
            arguments[parameter.arg] = scalar
        result, after = self._analysis.run(function, arguments, state)
        if after is not None:
            state.cells = after.cells
        return result

    def _structure(self, value: ast.expr, record: RecordSource, callee: str) -> Structure:
        found = self._found.structures.get(value.id) if isinstance(value, ast.Name) else None
        if found is None or found.type_name != record.name:
            raise self._refuse(value, f"{callee} needs a {record.name} here")
        return found


def joined_operation(
    node: ast.stmt, target: ast.expr, operator: ast.operator, value: ast.expr
) -> ast.BinOp:
    """The binary operation of an augmented assignment, one node per statement."""
    known: ast.BinOp | None = getattr(node, "h2nav_operation", None)
    if known is None:
        known = ast.copy_location(ast.BinOp(target, operator, value), node)
        node.h2nav_operation = known  # type: ignore[attr-defined]
    return known


def list_elements(value: ast.expr) -> list[ast.expr] | None:
    """The elements of a list display such as ``[a, b]`` or ``[0.0] * 3``; None for others."""
    match value:
        case ast.List(elts=elements):
            return elements
        case ast.BinOp(
            left=ast.List(elts=[element]), op=ast.Mult(), right=ast.Constant(value=int() as n)
        ):
            return [element] * n
    return None


def _annotation(
    kernel: Kernel, function: Function, argument: ast.arg
) -> Scalar | bool | RecordSource:
    """Range of an annotated scalar; for an array whether it holds floats; a record."""
    match argument.annotation:
        case ast.Name(id=name) if name in kernel.records:
            return kernel.records[name]
        case ast.Name(id="float"):
            return FLOAT
        case ast.Name(id=name) if name in _ANNOTATED:
            return _ANNOTATED[name]
        case ast.Subscript(value=ast.Name(id="list"), slice=ast.Name(id=name)):
            return name == "float"
    raise Untranslatable(
        function.path, argument, f"{argument.arg} needs an annotation of the subset"
    )
