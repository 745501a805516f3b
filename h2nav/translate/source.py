"""Reading of kernel modules: constants, functions and comments of Python text."""

import ast
import io
import math
import tokenize
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from h2nav.attitude import record
from h2nav.attitude.record import Row
from h2nav.attitude.velocity_aided.integer.shared import ROWS_BEHIND
from h2nav.attitude.velocity_aided.parameters import ROWS_OF_DECORATORS
from h2nav.errors import BadInput

Number = int | float
ConstantValue = Number | tuple["ConstantValue", ...]

# Modules with built-in support in the translator.
INTRINSIC_MODULES = (
    "math",
    "dataclasses",
    "typing",
    "h2nav.attitude.record",
    "h2nav.attitude.velocity_aided.integer.shared",
    "h2nav.attitude.velocity_aided.integer.shared_fields",
    "h2nav.attitude.velocity_aided.parameter_fields",
    "h2nav.attitude.velocity_aided.parameters",
    "h2nav.maths.fixedpoint",
)
ROW_MAKERS: dict[str, Callable[..., Any]] = {
    maker.__name__: maker for maker in (record.real, record.reals, record.integer, record.integers)
}


class KernelSource(NamedTuple):
    """Text of one kernel module."""

    path: str  # how errors name the file
    text: str  # the Python source


class Untranslatable(BadInput):
    """The kernel contains something that the translator does not support or cannot prove."""

    def __init__(self, path: str, node: ast.AST, reason: str) -> None:
        super().__init__(f"{path}:{getattr(node, 'lineno', 0)}: {reason}")


class Comment(NamedTuple):
    """A comment of the source and whether it stands on a line of its own."""

    text: str
    alone: bool


class Constant(NamedTuple):
    """A module constant, its value and the comment beside it."""

    name: str
    value: ConstantValue
    remark: str


@dataclass(frozen=True, slots=True)
class Function:
    """A kernel function with its file and comments."""

    name: str
    path: str
    node: ast.FunctionDef
    comments: Mapping[int, Comment]


class RecordSource(NamedTuple):
    """A record of `h2nav.attitude.record`, as declared in its module."""

    name: str  # of the class, which annotates arguments
    about: str  # first paragraph of its docstring
    rows: tuple[Row, ...]  # its fields in order


@dataclass(frozen=True, slots=True)
class Kernel:
    """One name space of all given modules, in order of definition."""

    constants: dict[str, Constant] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)
    records: dict[str, RecordSource] = field(default_factory=dict)


def read_kernel(sources: Sequence[KernelSource]) -> Kernel:
    """Reads the constants and functions of `sources`, each of which may import earlier ones.

    Raises:
        Untranslatable: a statement outside the subset, or a name defined twice.
    """
    kernel = Kernel()
    for source in sources:
        comments = _comments(source.text)
        for node in ast.parse(source.text).body:
            _read_statement(kernel, source.path, node, comments)
    return kernel


def _read_statement(
    kernel: Kernel, path: str, node: ast.stmt, comments: Mapping[int, Comment]
) -> None:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        if any(
            node.name in names for names in (kernel.functions, kernel.constants, kernel.records)
        ):
            raise Untranslatable(path, node, f"{node.name} is defined twice")
        if isinstance(node, ast.ClassDef):
            kernel.records[node.name] = _read_record(kernel, path, node)
        else:
            kernel.functions[node.name] = Function(node.name, path, node, comments)
    elif isinstance(node, ast.Assign | ast.AnnAssign):
        _read_constants(kernel, path, node, comments)
    elif isinstance(node, ast.ImportFrom):
        for alias in node.names:
            if alias.asname or not (
                _is_known(kernel, alias.name) or node.module in INTRINSIC_MODULES
            ):
                raise Untranslatable(
                    path, node, f"import of {alias.name} from a module not translated"
                )
    elif isinstance(node, ast.Import):
        if any(alias.name != "math" or alias.asname for alias in node.names):
            raise Untranslatable(path, node, "only math may be imported as a module")
    elif not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
        raise Untranslatable(path, node, f"a kernel module may not hold {type(node).__name__}")


def _read_constants(
    kernel: Kernel, path: str, node: ast.Assign | ast.AnnAssign, comments: Mapping[int, Comment]
) -> None:
    """Reads one assignment; all files become one in C, where a name has one value."""
    remark = comments.get(node.lineno, Comment("", alone=True))
    text = "" if remark.alone else remark.text
    for name, value in _definitions(kernel, path, node):
        if kernel.constants.setdefault(name, Constant(name, value, text)).value != value:
            raise Untranslatable(path, node, f"{name} has another value in a file before this one")


def _is_known(kernel: Kernel, name: str) -> bool:
    return name in kernel.constants or name in kernel.functions or name in kernel.records


def _read_record(kernel: Kernel, path: str, node: ast.ClassDef) -> RecordSource:
    names = {name.id for name in node.decorator_list if isinstance(name, ast.Name)}
    rows = _rows_by(names, ROWS_OF_DECORATORS)
    for statement in node.body:
        match statement:
            case ast.AnnAssign(
                target=ast.Name(id=name),
                value=ast.Call(func=ast.Name(id=maker), args=arguments, keywords=keywords),
            ) if maker in ROW_MAKERS:
                positional = [_row_argument(kernel, path, value) for value in arguments]
                named = {str(k.arg): _row_argument(kernel, path, k.value) for k in keywords}
                rows.append(record.named_row(name, ROW_MAKERS[maker](*positional, **named)))
            case (
                ast.Expr(value=ast.Constant(value=str()))
                | ast.If(test=ast.Name(id="TYPE_CHECKING"))
            ):
                pass
            case _:
                raise Untranslatable(path, statement, "a record holds only fields made by a row")
    rows += _rows_by(names, ROWS_BEHIND)
    about = (ast.get_docstring(node) or "").split("\n\n")[0]
    return RecordSource(node.name, about, tuple(rows))


def _rows_by(
    names: set[str], known: Mapping[str, Callable[[], list[record.Row]]]
) -> list[record.Row]:
    """The rows that decorators of these names add."""
    return [row for name in sorted(names & known.keys()) for row in known[name]()]


def _row_argument(kernel: Kernel, path: str, node: ast.expr) -> object:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    return constant_value(kernel.constants, path, node)


def _definitions(
    kernel: Kernel, path: str, node: ast.Assign | ast.AnnAssign
) -> list[tuple[str, ConstantValue]]:
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    if node.value is None or len(targets) != 1:
        raise Untranslatable(path, node, "a constant needs one name and a value")
    target, value = targets[0], constant_value(kernel.constants, path, node.value)
    if isinstance(target, ast.Name):
        return [(target.id, value)]
    if isinstance(target, ast.Tuple) and isinstance(value, tuple):
        names = [element.id for element in target.elts if isinstance(element, ast.Name)]
        if len(names) == len(target.elts) == len(value):
            return list(zip(names, value, strict=True))
    raise Untranslatable(path, node, "a constant is assigned to a name")


def constant_value(constants: Mapping[str, Constant], path: str, node: ast.expr) -> ConstantValue:
    """The value of a constant expression.

    Raises:
        Untranslatable: the expression is not made of numbers, known constants and arithmetic.
    """
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return value
        case ast.Name(id=name) if name in constants:
            return constants[name].value
        case ast.Attribute(value=ast.Name(id="math"), attr="pi" | "inf" | "tau" as name):
            return {"pi": math.pi, "inf": math.inf, "tau": math.tau}[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_number(constants, path, operand)
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            return _tuple_value(constants, path, elements)
        case ast.Call(func=ast.Name(id="range"), args=[stop]):
            return tuple(range(int(_number(constants, path, stop))))
        case ast.BinOp(left=left, op=operator, right=right):
            return _binary(
                path,
                node,
                operator,
                _number(constants, path, left),
                _number(constants, path, right),
            )
    raise Untranslatable(path, node, "not a constant expression of numbers and earlier constants")


def _tuple_value(
    constants: Mapping[str, Constant], path: str, elements: Sequence[ast.expr]
) -> tuple[ConstantValue, ...]:
    return tuple(constant_value(constants, path, element) for element in elements)


def _number(constants: Mapping[str, Constant], path: str, node: ast.expr) -> Number:
    value = constant_value(constants, path, node)
    if isinstance(value, tuple):
        raise Untranslatable(path, node, "a number is needed here")
    return value


def _binary(path: str, node: ast.expr, operator: ast.operator, a: Number, b: Number) -> Number:
    match operator:
        case ast.Add():
            return a + b
        case ast.Sub():
            return a - b
        case ast.Mult():
            return a * b
        case ast.Div():
            return a / b
        case ast.Pow() if isinstance(a, float):
            return float(a**b)
    if isinstance(a, int) and isinstance(b, int):
        match operator:
            case ast.FloorDiv():
                return a // b
            case ast.LShift():
                return a << b
            case ast.RShift():
                return a >> b
            case ast.BitOr():
                return a | b
            case ast.Pow() if b >= 0:
                return int(a**b)
    raise Untranslatable(path, node, f"constants may not be joined by {type(operator).__name__}")


def _comments(text: str) -> dict[int, Comment]:
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            words = token.string.lstrip("#").strip()
            if not words.startswith(("noqa", "type:", "fmt:")):
                words = words.split("  # noqa")[0]
                alone = token.line[: token.start[1]].strip() == ""
                found[token.start[0]] = Comment(words, alone)
    return found
