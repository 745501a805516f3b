"""Writes an analysed kernel as freestanding C99 with the same names, comments and arithmetic."""

import ast
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from h2nav.translate.c_expressions import (
    DOUBLE,
    INT32,
    ExpressionWriter,
    c_number,
    c_type,
    element_type,
)
from h2nav.translate.facts import Facts, FunctionFacts
from h2nav.translate.layout import (
    Block,
    broken,
    comment_lines,
    home_blocks,
    inner_blocks,
    mentioned,
    read_beside_write,
    written_arguments,
    written_at_once,
)
from h2nav.translate.ranges import analyse, joined_operation, list_elements
from h2nav.translate.runtime import operations
from h2nav.translate.source import (
    ConstantValue,
    Function,
    Kernel,
    KernelSource,
    Untranslatable,
    read_kernel,
)

CALLED = "CALLED"  # a macro that the text around the translation defines


class Translation(NamedTuple):
    """C text of a kernel: every function static, to be followed by an interface that calls them."""

    code: str  # constants, tables, operations and functions
    kernel: Kernel  # what was translated
    facts: Facts  # what was proved


def translate(
    sources: Sequence[KernelSource],
    entries: Sequence[str],
    initialisers: Sequence[str] = (),
    struct_names: Mapping[str, str] | None = None,
    called: Collection[str] = (),
) -> Translation:
    """Proves the ranges of a kernel and writes it as C99.

    Args:
        sources: the kernel modules, imported ones first.
        entries: functions that will be called from outside; see `ranges.analyse`.
        initialisers: functions that will be called on records of zeros.
        struct_names: record -> its C type; the record's own name for those not in it.
        called: functions that no compiler is to copy into their callers: marked ``CALLED``.

    Raises:
        Untranslatable: with file and line, whatever cannot be translated or proved.
    """
    kernel = read_kernel(sources)
    for name in (*entries, *initialisers, *called):
        if name not in kernel.functions:
            raise Untranslatable(sources[-1].path, ast.Pass(), f"there is no function {name}")
    facts = analyse(kernel, entries, initialisers)
    runtime: set[str] = set()
    writers: dict[str, list[bool]] = {}
    functions = []
    for name in facts.functions:
        function = kernel.functions[name]
        writer = _FunctionWriter(kernel, facts, function, writers, runtime, struct_names or {})
        melts = function.path == sources[-1].path or _is_expression(function)
        if name in called:
            writer.storage = f"static {CALLED}"
        elif melts and name not in (*entries, *initialisers):
            writer.storage = "static inline"
        functions.append(writer.text())
    parts = [_constants(kernel, facts), *operations(runtime), *functions]
    return Translation("\n".join(part for part in parts if part), kernel, facts)


def _is_expression(function: Function) -> bool:
    """True for a function that does nothing but return an expression."""
    body = function.node.body
    return isinstance(body[1 if ast.get_docstring(function.node) else 0], ast.Return)


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


class _FunctionWriter:
    def __init__(
        self,
        kernel: Kernel,
        facts: Facts,
        function: Function,
        writers: dict[str, list[bool]],
        runtime: set[str],
        struct_names: Mapping[str, str],
    ) -> None:
        self._kernel = kernel
        self._facts = facts
        self._function = function
        self._found: FunctionFacts = facts.functions[function.name]
        self._writers = writers
        self._struct_names = struct_names
        self._expressions = ExpressionWriter(kernel, facts, function, self._found, runtime)
        self._homes = home_blocks(function.node.body)
        self._lines: list[str] = []
        # Functions of the entry's own module and single expressions are inlined.
        self.storage = "static"
        self._declared: set[str] = {argument.arg for argument in function.node.args.args}
        self._last_line = function.node.body[0].lineno - 1

    def text(self) -> str:
        """The whole function."""
        node = self._function.node
        written = written_arguments(node, self._writers)
        self._writers[node.name] = [argument.arg in written for argument in node.args.args]
        parameters = ", ".join(self._parameter(a.arg, a.arg in written) for a in node.args.args)
        returns = "void" if self._found.result is None else c_type(self._found.result)
        docstring = ast.get_docstring(node)
        if docstring:
            self._lines.extend(comment_lines(docstring, ""))
        self._lines.append(f"{self.storage} {returns} {node.name}({parameters or 'void'})")
        self._lines.append("{")
        used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
        unused = [argument.arg for argument in node.args.args if argument.arg not in used]
        self._lines.extend(f"    (void){name};" for name in unused)
        self._block(node.body, "    ")
        self._lines.append("}")
        return "".join(f"{part}\n" for line in self._lines for part in broken(line))

    def _refuse(self, node: ast.AST, reason: str) -> Untranslatable:
        return Untranslatable(self._function.path, node, reason)

    def _parameter(self, name: str, written: bool) -> str:
        const = "" if written else "const "
        if name in self._found.structures:
            type_name = self._found.structures[name].type_name
            return f"{const}{self._struct_names.get(type_name, type_name)} *{name}"
        array = self._found.arrays.get(name)
        if array is None:
            return f"{c_type(self._found.scalars[name])} {name}"
        return f"{const}{element_type(array)} {name}[]"

    # statements

    def _block(self, body: Block, indent: str) -> None:
        waiting = {name for name, home in self._homes.items() if home == id(body)}
        for statement in body:
            self._carry_comments(statement, indent)
            for name in sorted((waiting & mentioned(statement)) - self._declared):
                if not self._declares(statement, name):
                    self._declare(name, indent)
            if written_at_once(statement, self._writers) > 1:
                raise self._refuse(statement, "two calls that write, which C makes in any order")
            read = read_beside_write(statement, self._writers)
            if read:
                raise self._refuse(statement, f"{read} is read beside a call that writes it")
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
            self._lines.append(f"{indent}{element_type(array)} {name}[{array.length}];")
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
                ends = [self._expressions.expression(bound).text for bound in bounds]
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
                self._lines.append(
                    f"{indent}{self._expressions.call(call).text};{self._remark(node)}"
                )

    def _head_remark(self, node: ast.If | ast.For) -> str:
        comment = self._function.comments.get(node.lineno)
        return f"  /* {comment.text} */" if comment and not comment.alone else ""

    def _if(self, node: ast.If, indent: str, word: str) -> None:
        self._lines.append(
            f"{indent}{word} ({self._expressions.test(node.test)}) {{{self._head_remark(node)}"
        )
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
        return self._expressions.expression(value).widened(c_type(self._found.result)).text

    def _assign(self, node: ast.stmt, target: ast.expr, value: ast.expr, indent: str) -> None:
        remark = self._remark(node)
        elements = list_elements(value)
        if isinstance(target, ast.Name) and elements is not None:
            self._assign_list(target.id, elements, indent, remark)
            return
        right = self._expressions.expression(value)
        if isinstance(target, ast.Name):
            type_name = c_type(self._found.scalars[target.id])
            head = target.id
            if target.id not in self._declared:
                self._declared.add(target.id)
                head = f"{type_name} {target.id}"
        else:
            left = self._expressions.expression(target, store=True)
            type_name, head = left.type, left.text
        self._lines.append(f"{indent}{head} = {right.widened(type_name).text};{remark}")

    def _assign_list(self, name: str, elements: list[ast.expr], indent: str, remark: str) -> None:
        array = self._found.arrays[name]
        texts = [
            self._expressions.expression(e).widened(element_type(array)).text for e in elements
        ]
        # of an initialiser some compilers make a call of memset
        if name not in self._declared:
            self._declared.add(name)
            self._lines.append(f"{indent}{element_type(array)} {name}[{array.length}];{remark}")
        self._lines.extend(f"{indent}{name}[{i}] = {text};" for i, text in enumerate(texts))
