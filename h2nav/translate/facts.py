"""State of the analysis while it runs through a kernel, and its results."""

import ast
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from h2nav.translate.intervals import Interval


class Float(NamedTuple):
    """The kind of every floating-point value; their ranges are not followed."""


FLOAT: Final = Float()
Scalar = Interval | Float


class Array(NamedTuple):
    """A flat array: an argument, a local list or a constant table."""

    key: int  # number of its memory
    is_float: bool  # elements are doubles, else 32-bit integers
    length: int | None  # number of elements; None for an argument of undeclared length
    writable: bool  # False for constant tables


class Structure(NamedTuple):
    """A record that is an argument; a single number is an array of one element."""

    type_name: str  # class of the record
    members: dict[str, Array]  # its fields by name
    numbers: frozenset[str]  # names of those that are single numbers


@dataclass(slots=True)
class ScopeState:
    """Scalars by name and array elements by array key, at one point of the program.

    Elements missing from an array of integers hold any 32-bit value. The elements of an array are
    never changed in place, only replaced as a whole: copies share them.
    """

    scalars: dict[str, Scalar] = field(default_factory=dict)
    cells: dict[int, dict[int, Interval]] = field(default_factory=dict)

    def copy(self) -> "ScopeState":
        """An independent copy."""
        return ScopeState(dict(self.scalars), dict(self.cells))

    def put(self, key: int, index: int, value: Interval) -> None:
        """Writes one element of an array."""
        self.cells[key] = {**self.cells[key], index: value}


def join_scalars(a: Scalar, b: Scalar) -> Scalar | None:
    """The common kind and range; None if one is a float and the other an integer."""
    if isinstance(a, Interval) and isinstance(b, Interval):
        return a.hull(b)
    return FLOAT if isinstance(a, Float) and isinstance(b, Float) else None


def join_states(a: ScopeState | None, b: ScopeState | None) -> ScopeState | None:
    """The state after either path; a name that only one path sets is unset afterwards."""
    if a is None or b is None:
        return a or b
    joined = ScopeState()
    for name in a.scalars.keys() & b.scalars.keys():
        scalar = join_scalars(a.scalars[name], b.scalars[name])
        if scalar is not None:
            joined.scalars[name] = scalar
    for key in a.cells.keys() & b.cells.keys():
        first, second = a.cells[key], b.cells[key]
        if first is not second:
            first = {i: first[i].hull(second[i]) for i in first.keys() & second.keys()}
        joined.cells[key] = first
    return joined


@dataclass(slots=True)
class FunctionFacts:
    """The proven facts of one function over all its calls."""

    # hull of every scalar variable, arguments included
    scalars: dict[str, Scalar] = field(default_factory=dict)
    # every array variable, arguments included
    arrays: dict[str, Array] = field(default_factory=dict)
    structures: dict[str, Structure] = field(default_factory=dict)  # the arguments that are records
    result: Scalar | None = None  # hull of the returned values; None when nothing is returned

    def returns(self, scalar: Scalar) -> bool:
        """Adds a returned value; False if it is a number of another kind than those before."""
        self.result = join_scalars(self.result or scalar, scalar)
        return self.result is not None


@dataclass(slots=True)
class Facts:
    """The result of the analysis, which determines the C types."""

    # hull of every expression over all visits
    nodes: dict[ast.expr, Scalar] = field(default_factory=dict)
    # in an order in which callees come before their callers
    functions: dict[str, FunctionFacts] = field(default_factory=dict)
    constants: set[str] = field(default_factory=set)  # names of the module constants that are used
