"""The small faults that are put into a module, one at a time, on the text of its source.

What a reader would not call behaviour is left alone: annotations, docstrings, texts, assertions.
"""

import ast
from collections.abc import Iterator
from typing import NamedTuple

SWAPPED: dict[type[ast.AST], tuple[str, ...]] = {
    ast.Add: ("-",),
    ast.Sub: ("+",),
    ast.Mult: ("/",),
    ast.Div: ("*",),
    ast.FloorDiv: ("*",),
    ast.Mod: ("*",),
    ast.Pow: ("*",),
    ast.LShift: (">>",),
    ast.RShift: ("<<",),
    ast.BitAnd: ("|",),
    ast.BitOr: ("&",),
    ast.BitXor: ("&",),
    ast.Lt: ("<=", ">"),
    ast.LtE: ("<", ">"),
    ast.Gt: (">=", "<"),
    ast.GtE: (">", "<"),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
    ast.And: ("or",),
    ast.Or: ("and",),
}
SYMBOLS = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.Pow: "**",
    ast.LShift: "<<",
    ast.RShift: ">>",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Is: "is",
    ast.IsNot: "is not",
    ast.In: "in",
    ast.NotIn: "not in",
    ast.And: "and",
    ast.Or: "or",
}
# Of a time in microseconds or a size in bytes one more is nothing that matters.
MANY = 1000
# To replace one of these by its counterpart only makes a TypeError that any test would see.
NO_NUMBERS = (ast.List, ast.Tuple, ast.Dict, ast.Set, ast.JoinedStr, ast.ListComp)


class Mutant(NamedTuple):
    """One fault.

    Attributes:
        module: path of the module, relative to the repository.
        line: where the fault is, from 1.
        start: first byte of the module that is replaced.
        stop: the byte behind the last one that is replaced.
        text: what stands there instead.
        kind: such as ``compare`` or ``constant``.
        within: name of the function around it; empty outside of functions.
    """

    module: str
    line: int
    start: int
    stop: int
    text: str
    kind: str
    within: str

    def applied(self, source: bytes) -> bytes:
        """The module with the fault in it."""
        return source[: self.start] + self.text.encode() + source[self.stop :]


def mutants(module: str, source: bytes) -> list[Mutant]:
    """Every mutant of a module, in the order of its text."""
    found = _Finder(module, source)
    found.visit(ast.parse(source))
    return sorted(set(found.mutants), key=lambda m: (m.start, m.stop, m.text))


class _Finder(ast.NodeVisitor):
    """Collects the mutants of a syntax tree."""

    def __init__(self, module: str, source: bytes) -> None:
        self.mutants: list[Mutant] = []
        self._module = module
        self._source = source
        self._line_starts = [0]
        for line in source.split(b"\n"):
            self._line_starts.append(self._line_starts[-1] + len(line) + 1)
        self._function = ""

    # --- what is left alone -------------------------------------------------------------------

    def visit_Assert(self, node: ast.Assert) -> None:
        """An assertion says what cannot happen."""

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """A text for people."""

    def visit_arg(self, node: ast.arg) -> None:
        """An argument is a name and an annotation."""

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """The value counts, the annotation does not."""
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Default values and body; not what is returned in types."""
        outer, self._function = self._function, node.name
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)
        self._function = outer

    def visit_Call(self, node: ast.Call) -> None:
        """The bounds of ``known(value, low, high)`` are an assertion as well."""
        if isinstance(node.func, ast.Name) and node.func.id == "known":
            self.visit(node.args[0])
        else:
            self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        """``zip(..., strict=True)`` is an assertion, too."""
        if node.arg != "strict":
            self.visit(node.value)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Decorators of a class are declarations."""
        for part in node.body:
            self.visit(part)

    # --- operators ----------------------------------------------------------------------------

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Arithmetic; unions of types and sequences are none."""
        sides = (node.left, node.right)
        if not any(_is_no_number(side) for side in sides):
            self._swap(node.op, node.left, node.right, "arithmetic")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """``+=`` and its kind; dropping one is a fault too."""
        if not _is_no_number(node.value):
            start, stop = self._end(node.target), self._start(node.value)
            symbol = SYMBOLS[type(node.op)]
            for other in SWAPPED[type(node.op)]:
                self._replace_symbol(node, start, stop, f"{symbol}=", f"{other}=", "arithmetic")
        self._delete(node)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        """Each relation of a chain."""
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            self._swap(op, left, right, "compare")
            left = right
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Each ``and`` and ``or``."""
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._swap(node.op, left, right, "boolean")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """A sign or a ``not`` that is lost."""
        if isinstance(node.op, (ast.USub, ast.Not)):
            start = self._start(node)
            width = len("not ") if isinstance(node.op, ast.Not) else len("-")
            self._add(node, start, start + width, "", "boolean")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """A number that is another one."""
        value = node.value
        if isinstance(value, bool):
            texts = [str(not value)]
        elif isinstance(value, int):
            texts = [str(value + 1 if value < MANY else value * 2)]
        elif isinstance(value, float):
            texts = [repr(value * 2.0 if value else 1.0), repr(value * 0.5 if value else -1.0)]
        else:
            return
        for text in texts:
            self._add(node, self._start(node), self._end(node), text, "constant")

    # --- statements ---------------------------------------------------------------------------

    def visit_If(self, node: ast.If) -> None:
        """A condition that is not compared is turned round."""
        self._negate(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        """As with ``if``."""
        self._negate(node.test)
        self.generic_visit(node)

    def visit_Return(self, node: ast.Return) -> None:
        """A result that is forgotten."""
        is_nothing = isinstance(node.value, ast.Constant) and not node.value.value
        if node.value is not None and not is_nothing:
            self._add(node, self._start(node.value), self._end(node.value), "None", "return")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        """A call that is left out; a text that stands alone is a docstring."""
        if isinstance(node.value, ast.Call):
            self._delete(node)
        self.generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> None:
        """A state that is not kept; without its first value nothing would run at all."""
        kept = all(isinstance(target, (ast.Attribute, ast.Subscript)) for target in node.targets)
        if kept and self._function not in ("", "__init__"):
            self._delete(node)
        self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """An error that is not raised."""
        self._delete(node)

    def visit_Continue(self, node: ast.Continue) -> None:
        """A round that goes on."""
        self._delete(node)

    def visit_Break(self, node: ast.Break) -> None:
        """A loop that goes on."""
        self._add(node, self._start(node), self._end(node), "continue", "statement")

    # --- places -------------------------------------------------------------------------------

    def _start(self, node: ast.expr | ast.stmt) -> int:
        return self._line_starts[node.lineno - 1] + node.col_offset

    def _end(self, node: ast.expr | ast.stmt) -> int:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._line_starts[node.end_lineno - 1] + node.end_col_offset

    def _add(self, node: ast.expr | ast.stmt, start: int, stop: int, text: str, kind: str) -> None:
        line = self._source.count(b"\n", 0, start) + 1
        self.mutants.append(Mutant(self._module, line, start, stop, text, kind, self._function))

    def _delete(self, node: ast.stmt) -> None:
        self._add(node, self._start(node), self._end(node), "pass", "statement")

    def _negate(self, test: ast.expr) -> None:
        if isinstance(test, (ast.Name, ast.Attribute, ast.Call)):
            old = self._source[self._start(test) : self._end(test)].decode()
            self._add(test, self._start(test), self._end(test), f"(not {old})", "boolean")

    def _swap(
        self,
        op: ast.operator | ast.cmpop | ast.boolop,
        left: ast.expr,
        right: ast.expr,
        kind: str,
    ) -> None:
        start, stop = self._end(left), self._start(right)
        for other in SWAPPED.get(type(op), ()):
            self._replace_symbol(right, start, stop, SYMBOLS[type(op)], other, kind)

    def _replace_symbol(
        self, node: ast.expr | ast.stmt, start: int, stop: int, old: str, new: str, kind: str
    ) -> None:
        """Between two operands stand the operator, brackets, white space and perhaps a comment."""
        at = self._source.find(old.encode(), start, stop)
        if at >= 0:
            self._add(node, at, at + len(old), new, kind)


def _is_no_number(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return node.value is None or isinstance(node.value, (str, bytes))
    return isinstance(node, NO_NUMBERS)


def code_lines(mutants_of_module: list[Mutant]) -> Iterator[tuple[int, list[Mutant]]]:
    """The lines that have mutants, each with its mutants."""
    by_line: dict[int, list[Mutant]] = {}
    for mutant in mutants_of_module:
        by_line.setdefault(mutant.line, []).append(mutant)
    yield from sorted(by_line.items())
