"""Layout of the C: places of declarations, const arguments, breaks of long lines."""

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence

Block = Sequence[ast.stmt]
_WIDTH = 100
_BREAKS = (" + ", " - ", ", ", " && ", " || ", " ? ", " : ", " * ", " & ", " | ")


def inner_blocks(statement: ast.stmt) -> list[Block]:
    """The blocks directly inside a compound statement."""
    if isinstance(statement, ast.If):
        return [statement.body, statement.orelse] if statement.orelse else [statement.body]
    return [statement.body] if isinstance(statement, ast.For) else []


def home_blocks(body: Block) -> dict[str, int]:
    """For every name the id of the innermost block that holds all its occurrences."""
    homes: dict[str, tuple[int, ...]] = {}
    for name, path in _occurrences(body, (id(body),)):
        known = homes.get(name, path)
        same = 0
        while same < min(len(known), len(path)) and known[same] == path[same]:
            same += 1
        homes[name] = path[:same]
    return {name: path[-1] for name, path in homes.items()}


def _occurrences(body: Block, path: tuple[int, ...]) -> Iterator[tuple[str, tuple[int, ...]]]:
    for statement in body:
        inner = inner_blocks(statement)
        for node in _own_nodes(statement):
            if isinstance(node, ast.Name):
                yield node.id, path
        for block in inner:
            yield from _occurrences(block, (*path, id(block)))


def _own_nodes(statement: ast.stmt) -> Iterator[ast.AST]:
    """The nodes of a statement without those of the blocks inside it."""
    if isinstance(statement, ast.If):
        yield from ast.walk(statement.test)
    elif isinstance(statement, ast.For):
        yield from ast.walk(statement.iter)
    else:
        yield from ast.walk(statement)


def mentioned(statement: ast.stmt) -> set[str]:
    """All names inside a statement, inner blocks included."""
    return {node.id for node in ast.walk(statement) if isinstance(node, ast.Name)}


def written_arguments(function: ast.FunctionDef, writers: dict[str, list[bool]]) -> set[str]:
    """Names of the arrays and records that a function writes, itself or through those it calls.

    Args:
        writers: for each function already seen, which of its arguments it writes.
    """
    written = set()
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript | ast.Attribute) and isinstance(node.ctx, ast.Store):
            written.add(_owner(node))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            flags = writers.get(node.func.id, [])
            for argument, writes in zip(node.args, flags, strict=False):
                if writes:
                    written.add(_owner(argument))
    return written


def written_at_once(node: ast.AST, writers: Mapping[str, list[bool]]) -> int:
    """How many calls that write stand side by side in a statement: C makes them in any order.

    Args:
        node: the statement or a part of it; blocks inside it do not count.
        writers: for each function already seen, which of its arguments it writes.
    """
    if isinstance(node, ast.BoolOp):  # `and` and `or` keep the order
        return max(written_at_once(value, writers) for value in node.values)
    count = sum(written_at_once(part, writers) for part in _parts(node))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        # a call comes behind those in its arguments
        return max(count, int(any(writers.get(node.func.id, []))))
    return count


def read_beside_write(node: ast.AST, writers: Mapping[str, list[bool]]) -> str:
    """What a statement reads beside a call that writes it: C may read before or after; "" without.

    Args:
        node: the statement or a part of it; blocks inside it do not count.
        writers: see `written_at_once`.
    """
    parts = list(_parts(node))
    writing = [(part, written) for part in parts if (written := _written(part, writers))]
    for part, _ in writing:
        inner = read_beside_write(part, writers)
        if inner:
            return inner
    if isinstance(node, ast.BoolOp):
        return ""
    if isinstance(node, ast.AugAssign) and _owner(node.target) in _written(node.value, writers):
        return _owner(node.target)
    for part, written in writing:
        both = written & _read(other for other in parts if other is not part)
        if both:
            return min(both)
    return ""


def _parts(node: ast.AST) -> Iterable[ast.AST]:
    if isinstance(node, ast.If | ast.For):
        return [node.test if isinstance(node, ast.If) else node.iter]
    return ast.iter_child_nodes(node)


def _written(node: ast.AST, writers: Mapping[str, list[bool]]) -> set[str]:
    """The records and arrays that the calls in an expression write."""
    return {
        _owner(argument)
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
        for argument, writes in zip(call.args, writers.get(call.func.id, []), strict=False)
        if writes
    }


def _read(nodes: Iterable[ast.AST]) -> set[str]:
    """The records and arrays of which some expressions read a number."""
    return {
        _owner(each)
        for node in nodes
        for each in ast.walk(node)
        if isinstance(each, ast.Subscript | ast.Attribute) and isinstance(each.ctx, ast.Load)
    }


def _owner(node: ast.expr) -> str:
    """The variable that an element or a field belongs to."""
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def broken(line: str) -> Iterator[str]:
    """A long line of C, broken after operators, continued with a deeper indent."""
    indent = line[: len(line) - len(line.lstrip())]
    while len(line) > _WIDTH:
        found = ((line.rfind(mark, len(indent) + 8, _WIDTH), len(mark)) for mark in _BREAKS)
        cut = max(start + length - 1 if start >= 0 else -1 for start, length in found)
        if cut < 0:
            break
        yield line[:cut].rstrip()
        line = f"{indent}    {line[cut:].lstrip()}"
    yield line


def comment_lines(text: str, indent: str) -> list[str]:
    """A C comment of one or several lines."""
    lines = [line.rstrip() for line in text.replace("*/", "* /").strip().splitlines()]
    if len(lines) == 1:
        return [f"{indent}/* {lines[0]} */"]
    rest = [f"{indent} * {line}".rstrip() for line in lines[1:]]
    return [f"{indent}/* {lines[0]}", *rest, f"{indent} */"]
