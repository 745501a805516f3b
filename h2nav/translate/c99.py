"""Writes an analysed kernel as freestanding C99: same names, same comments, same arithmetic."""

import ast
import math
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.translate.facts import Array, Facts, Float, FunctionFacts, Scalar
from h2nav.translate.intervals import Interval, subtract
from h2nav.translate.layout import (
    Block,
    broken,
    comment_lines,
    home_blocks,
    inner_blocks,
    mentioned,
    written_arrays,
)
from h2nav.translate.ranges import analyse, joined_operation, list_elements
from h2nav.translate.runtime import RUNTIME
from h2nav.translate.source import (
    ConstantValue,
    Function,
    Kernel,
    Number,
    Refused,
    Source,
    read_kernel,
)

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


class Translation(NamedTuple):
    """C text of a kernel: every function static, to be followed by an interface that calls them.

    Attributes:
        code: constants, tables, operations and functions.
        kernel: what was translated.
        facts: what was proved.
    """

    code: str
    kernel: Kernel
    facts: Facts


def translate(
    sources: Sequence[Source], entries: Sequence[str], initialisers: Sequence[str] = ()
) -> Translation:
    """Proves the ranges of a kernel and writes it as C99.

    Args:
        sources: the kernel modules, imported ones first.
        entries: functions that will be called from outside; see `ranges.analyse`.
        initialisers: functions that will be called on uninitialised arrays.

    Raises:
        Refused: with file and line, whatever cannot be translated or proved.
    """
    kernel = read_kernel(sources)
    for name in (*entries, *initialisers):
        if name not in kernel.functions:
            raise Refused(sources[-1].path, ast.Pass(), f"there is no function {name}")
    facts = analyse(kernel, entries, initialisers)
    runtime: set[str] = set()
    writers: dict[str, list[bool]] = {}
    functions = []
    for name in facts.functions:
        function = kernel.functions[name]
        writer = _FunctionWriter(kernel, facts, function, writers, runtime)
        writer.inline = function.path == sources[-1].path and name not in (*entries, *initialisers)
        functions.append(writer.text())
    parts = [_constants(kernel, facts), *(RUNTIME[n] for n in RUNTIME if n in runtime), *functions]
    return Translation("\n".join(part for part in parts if part), kernel, facts)


def c_number(value: Number) -> str:
    """A literal of exactly this value."""
    if isinstance(value, float):
        return repr(value)
    if value == -(1 << 31):
        return "(-INT32_C(2147483647) - 1)"
    bits = 32 if Interval(value, value).fits(32) else 64
    return f"INT{bits}_C({value})" if value >= 0 else f"(-INT{bits}_C({-value}))"


def _constants(kernel: Kernel, facts: Facts) -> str:
    """Definitions of the constants in use; tables and scalars keep their order."""
    lines: list[str] = []
    for constant in kernel.constants.values():
        if constant.name not in facts.constants:
            continue
        remark = f"  /* {constant.remark} */" if constant.remark else ""
        if isinstance(constant.value, tuple):
            lines.extend(broken(_table(constant.name, constant.value) + remark))
        else:
            lines.append(f"#define {constant.name} {c_number(constant.value)}{remark}")
    return "\n".join(lines) + "\n" if lines else ""


def _table(name: str, values: tuple[ConstantValue, ...]) -> str:
    kind = DOUBLE if isinstance(values[0], float) else INT32
    numbers = ", ".join(c_number(value) for value in values if not isinstance(value, tuple))
    return f"static const {kind} {name}[{len(values)}] = {{{numbers}}};"


def c_type(kind: Scalar) -> str:
    """The C type that holds every value of a kind."""
    if isinstance(kind, Float):
        return DOUBLE
    return INT32 if kind.fits(32) else INT64


class _Text(NamedTuple):
    """C text of an expression, how tightly it binds, its C type."""

    text: str
    level: int
    type: str

    def at(self, level: int) -> str:
        return self.text if self.level >= level else f"({self.text})"

    def cast(self, type_name: str) -> "_Text":
        if self.type == type_name:
            return self
        return _Text(f"({type_name}){self.at(_UNARY)}", _UNARY, type_name)

    def widened(self, type_name: str) -> "_Text":
        """Explicit only where C would not widen by itself, or leaves the integers."""
        explicit = (self.type == INT64 and type_name == INT32) or type_name == DOUBLE
        return self.cast(type_name) if explicit else self


class _FunctionWriter:
    def __init__(
        self,
        kernel: Kernel,
        facts: Facts,
        function: Function,
        writers: dict[str, list[bool]],
        runtime: set[str],
    ) -> None:
        self._kernel = kernel
        self._facts = facts
        self._function = function
        self._found: FunctionFacts = facts.functions[function.name]
        self._writers = writers
        self._runtime = runtime
        self._homes = home_blocks(function.node.body)
        self._lines: list[str] = []
        # Small functions of the entry's own module are meant to melt into it.
        self.inline = False
        self._declared: set[str] = {argument.arg for argument in function.node.args.args}
        self._last_line = function.node.body[0].lineno - 1

    def text(self) -> str:
        """The whole function."""
        node = self._function.node
        written = written_arrays(node, self._writers)
        self._writers[node.name] = [argument.arg in written for argument in node.args.args]
        parameters = ", ".join(self._parameter(a.arg, a.arg in written) for a in node.args.args)
        returns = "void" if self._found.result is None else c_type(self._found.result)
        docstring = ast.get_docstring(node)
        if docstring:
            self._lines.extend(comment_lines(docstring, ""))
        inline = "inline " if self.inline else ""
        self._lines.append(f"static {inline}{returns} {node.name}({parameters or 'void'})")
        self._lines.append("{")
        used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        unused = [argument.arg for argument in node.args.args if argument.arg not in used]
        self._lines.extend(f"    (void){name};" for name in unused)
        self._block(node.body, "    ")
        self._lines.append("}")
        return "".join(f"{part}\n" for line in self._lines for part in broken(line))

    def _refuse(self, node: ast.AST, reason: str) -> Refused:
        return Refused(self._function.path, node, reason)

    def _parameter(self, name: str, written: bool) -> str:
        array = self._found.arrays.get(name)
        if array is None:
            return f"{c_type(self._found.scalars[name])} {name}"
        return f"{'' if written else 'const '}{_element_type(array)} {name}[]"

    # statements

    def _block(self, body: Block, indent: str) -> None:
        waiting = {name for name, home in self._homes.items() if home == id(body)}
        for statement in body:
            self._carry_comments(statement, indent)
            for name in sorted((waiting & mentioned(statement)) - self._declared):
                if not self._declares(statement, name):
                    self._declare(name, indent)
            self._statement(statement, indent)

    def _declares(self, statement: ast.stmt, name: str) -> bool:
        """True when the statement itself can be the declaration of `name`."""
        match statement:
            case (
                ast.Assign(targets=[ast.Name(id=target)])
                | ast.AnnAssign(target=ast.Name(id=target))
            ):
                return target == name
        return False

    def _declare(self, name: str, indent: str) -> None:
        if name in self._found.arrays:
            array = self._found.arrays[name]
            self._lines.append(f"{indent}{_element_type(array)} {name}[{array.length}];")
        elif name in self._found.scalars and not self._is_loop_variable(name):
            self._lines.append(f"{indent}{c_type(self._found.scalars[name])} {name};")
        else:
            return
        self._declared.add(name)

    def _is_loop_variable(self, name: str) -> bool:
        loops = (node for node in ast.walk(self._function.node) if isinstance(node, ast.For))
        return any(isinstance(loop.target, ast.Name) and loop.target.id == name for loop in loops)

    def _carry_comments(self, statement: ast.stmt, indent: str) -> None:
        lines = range(self._last_line + 1, statement.lineno + 1)
        found = [self._function.comments[n] for n in lines if n in self._function.comments]
        alone = [comment.text for comment in found if comment.alone]
        if alone:
            self._lines.extend(comment_lines("\n".join(alone), indent))
        inner = inner_blocks(statement)
        self._last_line = statement.lineno if inner else statement.end_lineno or statement.lineno

    def _remark(self, statement: ast.stmt) -> str:
        comment = self._function.comments.get(statement.end_lineno or statement.lineno)
        return f"  /* {comment.text} */" if comment and not comment.alone else ""

    def _statement(self, node: ast.stmt, indent: str) -> None:
        match node:
            case ast.Assign(targets=[target], value=value):
                self._assign(node, target, value, indent)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                self._assign(node, target, value, indent)
            case ast.AugAssign(target=target, op=operator, value=value):
                self._assign(node, target, joined_operation(node, target, operator, value), indent)
            case ast.If():
                self._if(node, indent, "if")
            case ast.For(target=ast.Name(id=name), iter=ast.Call(args=bounds)):
                ends = [self._expression(bound).text for bound in bounds]
                start, stop = ("0", ends[0]) if len(ends) == 1 else (ends[0], ends[1])
                header = f"for (int32_t {name} = {start}; {name} < {stop}; {name}++)"
                self._lines.append(f"{indent}{header} {{{self._head_remark(node)}")
                self._block(node.body, indent + "    ")
                self._lines.append(f"{indent}}}")
            case ast.Return(value=value):
                empty = value is None or self._found.result is None
                result = "" if empty or value is None else f" {self._returned(value)}"
                self._lines.append(f"{indent}return{result};{self._remark(node)}")
            case ast.Expr(value=ast.Call() as call):
                self._lines.append(f"{indent}{self._call(call).text};{self._remark(node)}")

    def _head_remark(self, node: ast.If | ast.For) -> str:
        comment = self._function.comments.get(node.lineno)
        return f"  /* {comment.text} */" if comment and not comment.alone else ""

    def _if(self, node: ast.If, indent: str, word: str) -> None:
        self._lines.append(f"{indent}{word} ({self._test(node.test)}) {{{self._head_remark(node)}")
        self._block(node.body, indent + "    ")
        if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
            self._last_line = node.orelse[0].lineno
            self._if(node.orelse[0], indent, "} else if")
            return
        if node.orelse:
            self._lines.append(f"{indent}}} else {{")
            self._block(node.orelse, indent + "    ")
        self._lines.append(f"{indent}}}")

    def _returned(self, value: ast.expr) -> str:
        assert self._found.result is not None
        return self._expression(value).widened(c_type(self._found.result)).text

    def _assign(self, node: ast.stmt, target: ast.expr, value: ast.expr, indent: str) -> None:
        remark = self._remark(node)
        elements = list_elements(value)
        if isinstance(target, ast.Name) and elements is not None:
            self._assign_list(target.id, elements, indent, remark)
            return
        right = self._expression(value)
        if isinstance(target, ast.Name):
            type_name = c_type(self._found.scalars[target.id])
            head = target.id
            if target.id not in self._declared:
                self._declared.add(target.id)
                head = f"{type_name} {target.id}"
        else:
            left = self._expression(target, store=True)
            type_name, head = left.type, left.text
        self._lines.append(f"{indent}{head} = {right.widened(type_name).text};{remark}")

    def _assign_list(self, name: str, elements: list[ast.expr], indent: str, remark: str) -> None:
        array = self._found.arrays[name]
        texts = [self._expression(e).widened(_element_type(array)).text for e in elements]
        if name not in self._declared:
            self._declared.add(name)
            head = f"{indent}{_element_type(array)} {name}[{array.length}]"
            self._lines.append(f"{head} = {{{', '.join(texts)}}};{remark}")
        else:
            self._lines.extend(f"{indent}{name}[{i}] = {text};" for i, text in enumerate(texts))

    # expressions

    def _kind(self, node: ast.expr) -> Scalar:
        kind = self._facts.nodes.get(node)
        if kind is None:
            raise self._refuse(node, "is never reached")
        return kind

    def _expression(self, node: ast.expr, store: bool = False) -> _Text:
        match node:
            case ast.Constant(value=int() | float() as value):
                return _Text(c_number(value), _ATOM, c_type(self._kind(node)))
            case ast.Attribute():
                return _Text(c_number(math.pi), _ATOM, DOUBLE)
            case ast.Name(id=name):
                if name in self._found.scalars:
                    return _Text(name, _ATOM, c_type(self._found.scalars[name]))
                return _Text(name, _ATOM, c_type(self._kind(node)))
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                return self._element(node, name, index, store)
            case ast.UnaryOp(op=operator, operand=operand):
                return self._unary(node, operator, self._expression(operand))
            case ast.BinOp(left=left, op=ast.LShift(), right=right):
                return self._scaled(node, left, right)
            case ast.BinOp(left=left, op=ast.RShift(), right=right):
                return self._shifted(node, left, right)
            case ast.BinOp(left=left, op=operator, right=right):
                return self._binary(node, self._expression(left), operator, self._expression(right))
            case ast.IfExp(test=test, body=body, orelse=orelse):
                a, b = self._expression(body), self._expression(orelse)
                type_name = DOUBLE if DOUBLE in (a.type, b.type) else max(a.type, b.type)
                choice = f"({self._test(test)} ? {a.at(_SUM)} : {b.at(_SUM)})"
                return _Text(choice, _ATOM, type_name)
            case ast.Call():
                return self._call(node)
        raise self._refuse(node, f"{type(node).__name__} is outside the subset")

    def _element(self, node: ast.Subscript, name: str, index: ast.expr, store: bool) -> _Text:
        if name in self._found.arrays:
            array_type = _element_type(self._found.arrays[name])
        else:
            self._facts.constants.add(name)
            array_type = c_type(self._kind(node)) if not store else INT32
        if isinstance(index, ast.Constant):
            return _Text(f"{name}[{index.value!r}]", _ATOM, array_type)
        return _Text(f"{name}[{self._expression(index).text}]", _ATOM, array_type)

    def _result(self, node: ast.expr, text: _Text) -> _Text:
        """`text` narrowed to 32 bits where its range is proved to fit."""
        kind = self._kind(node)
        narrow = text.type == INT64 and isinstance(kind, Interval) and kind.fits(32)
        return text.cast(INT32) if narrow else text

    def _unary(self, node: ast.expr, operator: ast.unaryop, value: _Text) -> _Text:
        sign = "-" if isinstance(operator, ast.USub) else "~"
        wide = value.cast(c_type(self._kind(node))) if value.type == INT32 else value
        text = wide.at(_ATOM)
        return self._result(node, _Text(f"{sign}{text}", _UNARY, wide.type))

    def _scaled(self, node: ast.expr, left: ast.expr, right: ast.expr) -> _Text:
        """A shift to the left, written as the product that it is."""
        value, n = self._expression(left), self._kind(right)
        assert isinstance(n, Interval)
        if n.lo == n.hi:
            factor = _Text(c_number(1 << n.lo), _ATOM, INT32 if n.lo < 31 else INT64)
        else:
            count = self._expression(right).at(_ATOM)
            factor = _Text(f"(INT32_C(1) << {count})", _ATOM, INT32)
        return self._binary(node, value, ast.Mult(), factor)

    def _shifted(self, node: ast.expr, left: ast.expr, right: ast.expr) -> _Text:
        value, kind = self._expression(left), self._kind(left)
        n = self._kind(right)
        assert isinstance(kind, Interval)
        assert isinstance(n, Interval)
        count = str(n.lo) if n.lo == n.hi else self._expression(right).at(_ATOM)
        if kind.lo >= 0:
            return self._result(node, _Text(f"{value.at(_ATOM)} >> {count}", _OTHER, value.type))
        name = f"shift_right_{64 if value.type == INT64 else 32}"
        self._runtime.add(name)
        return self._result(node, _Text(f"{name}({value.text}, {count})", _ATOM, value.type))

    def _binary(self, node: ast.expr, a: _Text, operator: ast.operator, b: _Text) -> _Text:
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
        return self._result(node, _Text(text, level, type_name))

    def _call(self, node: ast.Call) -> _Text:
        match node.func:
            case ast.Attribute(attr=name):
                arguments = ", ".join(self._expression(value).text for value in node.args)
                return _Text(f"{name}({arguments})", _ATOM, DOUBLE)
            case ast.Name(id="float"):
                return self._expression(node.args[0]).cast(DOUBLE)
            case ast.Name(id="abs"):
                value = self._expression(node.args[0])
                if not isinstance(self._kind(node), Interval) or value.type == INT32:
                    value = value.cast(c_type(self._kind(node)))
                name = f"magnitude_{64 if value.type == INT64 else 32}"
                self._runtime.add(name)
                return self._result(node, _Text(f"{name}({value.text})", _ATOM, value.type))
            case ast.Name(id="clamp"):
                return self._clamp(node)
            case ast.Name(id="known"):
                return self._result(node, self._expression(node.args[0]))
            case ast.Name(id="known"):
                return self._result(node, self._expression(node.args[0]))
            case ast.Name(id=name):
                return self._kernel_call(node, name)
        raise self._refuse(node, "call outside the subset")

    def _clamp(self, node: ast.Call) -> _Text:
        x, low, high = (self._expression(part) for part in node.args)
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
        return self._result(node, _Text(text, _ATOM, f"int{bits}_t"))

    def _kernel_call(self, node: ast.Call, name: str) -> _Text:
        callee = self._facts.functions[name]
        arguments = []
        parameters = self._kernel.functions[name].node.args.args
        for parameter, value in zip(parameters, node.args, strict=True):
            if parameter.arg in callee.arrays:
                assert isinstance(value, ast.Name)
                arguments.append(value.id)
            else:
                wanted = c_type(callee.scalars[parameter.arg])
                arguments.append(self._expression(value).widened(wanted).text)
        type_name = "void" if callee.result is None else c_type(callee.result)
        text = _Text(f"{name}({', '.join(arguments)})", _ATOM, type_name)
        return text if callee.result is None else self._result(node, text)

    def _test(self, node: ast.expr) -> str:
        match node:
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"!({self._test(operand)})"
            case ast.BoolOp(op=junction, values=values):
                word = " && " if isinstance(junction, ast.And) else " || "
                parts = (self._test(value) for value in values)
                return word.join(f"({p})" if "&&" in p or "||" in p else p for p in parts)
            case ast.Compare(left=left, ops=operators, comparators=operands):
                terms = []
                for operator, right in zip(operators, operands, strict=True):
                    a, b = self._expression(left), self._expression(right)
                    if DOUBLE in (a.type, b.type):
                        a, b = a.cast(DOUBLE), b.cast(DOUBLE)
                    terms.append(f"{a.at(_SUM)} {_COMPARISONS[type(operator)]} {b.at(_SUM)}")
                    left = right
                return " && ".join(terms)
        raise self._refuse(node, "a test is a comparison, or comparisons joined by and, or, not")


def _element_type(array: Array) -> str:
    return DOUBLE if array.is_float else INT32
