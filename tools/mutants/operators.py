"""All changes that a module's syntax tree allows, each within one line.

Left alone: docstrings, annotations, decorators, imports, and what only words an error message.
"""

import ast
from collections.abc import Iterator
from itertools import pairwise

from tools.mutants.mutant import Mutant

SWAPPED: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"), ast.Sub: ("-", "+"), ast.Mult: ("*", "/"), ast.Div: ("/", "*"), ast.Pow: ("**", "*"), ast.Mod: ("%", "*"),
    ast.FloorDiv: ("//", "*"), ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&"), ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="), ast.GtE: (">=", ">"), ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="), ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"), ast.In: ("in", "not in"), ast.NotIn: ("not in", "in"),
    ast.And: ("and", "or"), ast.Or: ("or", "and"),
}  # fmt: skip
FUNCTIONS_EXCHANGED = {
    "min": "max",
    "max": "min",
    "maximum": "minimum",
    "minimum": "maximum",
    "sin": "cos",
    "cos": "sin",
    "any": "all",
    "all": "any",
}


def mutants(file: str, text: str) -> list[Mutant]:
    """Every change of one module, in the order of its lines."""
    found = {}
    for node in _code(ast.parse(text)):
        for number, start, end, put, kind in _changes(node, text.split("\n")):
            line = text.split("\n")[number - 1].encode()
            new = (line[:start] + put.encode() + line[end:]).decode()
            mutant = Mutant(file, number, line.decode(), new, kind)
            found[mutant.number, mutant.new] = mutant
    return [found[key] for key in sorted(found)]


def _code(node: ast.AST) -> Iterator[ast.AST]:
    """The tree without what is left alone."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom):
                continue
            yield child
            yield from _code(child)


Change = tuple[int, int, int, str, str]  # line, first and last byte in it, what to put there, kind


def _changes(node: ast.AST, lines: list[str]) -> Iterator[Change]:
    match node:
        case ast.BinOp(left, op, right) | ast.AugAssign(left, op, right):
            yield from _between(left, op, right, lines, "arithmetic")
        case ast.Compare(left, ops, rights):
            for op, a, b in zip(ops, [left, *rights], rights, strict=False):
                yield from _between(a, op, b, lines, "comparison")
        case ast.BoolOp(op, values):
            for a, b in pairwise(values):
                yield from _between(a, op, b, lines, "boolean")
        case ast.UnaryOp(ast.USub() | ast.Not() as op):
            token = len("-") if isinstance(op, ast.USub) else len("not ")
            yield node.lineno, node.col_offset, node.col_offset + token, "", "sign"
        case ast.Constant(bool() as value):
            yield *_span(node), str(not value), "boolean"
        case ast.Constant(int() as value):
            yield *_span(node), str(value + 1), "off by one"
        case ast.Constant(float() as value) if value:
            yield *_span(node), repr(2.0 * value), "constant"
            yield *_span(node), repr(0.5 * value), "constant"
        case ast.Name(id=name) | ast.Attribute(attr=name) if name in FUNCTIONS_EXCHANGED:
            number, _, end = _span(node)
            yield number, end - len(name), end, FUNCTIONS_EXCHANGED[name], "function"
    yield from _dropped(node)


def _dropped(node: ast.AST) -> Iterator[Change]:
    dropped = isinstance(node, ast.AugAssign | ast.Continue | ast.Break)
    if dropped or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
        number, start, end = _span(node)
        if node.lineno == node.end_lineno:  # type: ignore[attr-defined]
            yield number, start, end, "pass", "statement"


def _span(node: ast.AST) -> tuple[int, int, int]:
    """Last line of a node, its first byte (of its first line) and its last."""
    return node.end_lineno, node.col_offset, node.end_col_offset  # type: ignore[attr-defined]


def _between(left: ast.AST, op: ast.AST, right: ast.AST, lines: list[str], kind: str) -> Iterator[Change]:
    """The operator's token, which stands alone between its operands."""
    number, end, start = left.end_lineno, left.end_col_offset, right.col_offset  # type: ignore[attr-defined]
    if type(op) not in SWAPPED or number != right.lineno:  # type: ignore[attr-defined]
        return
    token, put = SWAPPED[type(op)]
    at = lines[number - 1].encode().find(token.encode(), end, start)
    if at >= 0:
        yield number, at, at + len(token), put, kind
