"""Mutations: the small changes of a module's source that its tests should notice.

Each mutation changes one node of the module's syntax tree. Documentation, annotations, decorators,
imports, assertions, log calls, texts of errors and ``__repr__`` are left as they are.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

COMPARISONS: dict[type, tuple[type, ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
"""For each comparison its boundary, where it has one, and its negation."""

ARITHMETIC: dict[type, type] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
}
_PAIRS = "min max, minimum maximum, nanmin nanmax, argmin argmax, fmin fmax, any all, floor ceil"
OPPOSITES = {
    name: opposite
    for pair in _PAIRS.split(", ")
    for name, opposite in (pair.split(), reversed(pair.split()))
}
KERNEL_DECORATORS = {"kernel", "njit"}
LOGGERS = {"log", "logger", "logging", "warnings"}
SKIPPED_FUNCTIONS = {"__repr__", "__str__"}
CONTEXT = 40
"""Characters that a description shows on either side of the change."""

Defaults = dict[str, set[str]]
"""Parameters with a default, by the name of the function or class that takes them."""


@dataclass(frozen=True)
class Mutation:
    """One changed node of a module.

    Attributes
    ----------
    function : str
        Qualified name of the function or class around it; empty at the module's top level.
    line : int
        Line of the changed statement in the original source.
    operator : str
        Kind of the change.
    original, mutated : str
        The statement before and after, shortened around the change.
    source : str
        The whole mutated module.
    """

    function: str
    line: int
    operator: str
    original: str
    mutated: str
    source: str

    @property
    def name(self) -> str:
        """Function, original and mutated source."""
        return f"{self.function or '<module>'}: {self.original} -> {self.mutated}"


@dataclass(frozen=True)
class _Place:
    """Where a node is: the statement that shows it, and the function around it."""

    function: str
    statement: ast.AST
    in_kernel: bool = False


@dataclass(frozen=True)
class _Edit:
    """Set one field of one node to another value."""

    place: _Place
    operator: str
    owner: ast.AST
    field: str
    value: Any


def mutations_of(source: str, defaults: Defaults | None = None) -> list[Mutation]:
    """All mutations of a module, in source order; each mutated source occurs once.

    Parameters
    ----------
    source : str
        Source of the module.
    defaults : mapping of str to set of str, optional
        See `defaults_of`. A keyword argument of a function that is not in it counts as optional.

    Examples
    --------
    >>> [mutation.mutated for mutation in mutations_of("def f(x): return x < 3")]
    ['return not x < 3', 'return x <= 3', 'return x >= 3', 'return x < 4']
    """
    tree = ast.parse(source)
    original = ast.unparse(tree)
    known = {original}
    found = []
    for edit in _Finder(defaults or {}).edits(tree):
        before = _shown(edit.place.statement)
        kept = getattr(edit.owner, edit.field)
        setattr(edit.owner, edit.field, edit.value)
        mutated, after = ast.unparse(tree), _shown(edit.place.statement)
        setattr(edit.owner, edit.field, kept)
        if mutated in known:
            continue
        known.add(mutated)
        texts = _shortened(before, after)
        if edit.operator == "drop statement":
            texts = (before, "pass")
        line = _line(edit.place.statement)
        found.append(Mutation(edit.place.function, line, edit.operator, *texts, mutated))
    return _told_apart(sorted(found, key=lambda mutation: mutation.line))


def defaults_of(sources: list[str]) -> Defaults:
    """Which parameters have a default, for all functions and classes of some modules.

    Where a name is defined more than once, a parameter counts that is optional everywhere.
    """
    defaults: Defaults = {}
    for source in sources:
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef):
                optional = _optional_parameters(node.args)
            elif isinstance(node, ast.ClassDef):
                optional = {
                    field.target.id
                    for field in node.body
                    if isinstance(field, ast.AnnAssign) and field.value is not None
                    if isinstance(field.target, ast.Name)
                }
            else:
                continue
            defaults[node.name] = defaults.get(node.name, optional) & optional
    return defaults


def _optional_parameters(arguments: ast.arguments) -> set[str]:
    positional = [*arguments.posonlyargs, *arguments.args]
    optional = {one.arg for one in positional[len(positional) - len(arguments.defaults) :]}
    keyword_only = zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
    return optional | {one.arg for one, default in keyword_only if default is not None}


class _Finder:
    """Walks a module and proposes edits."""

    def __init__(self, defaults: Defaults) -> None:
        self.defaults = defaults

    def edits(self, tree: ast.Module) -> Iterator[_Edit]:
        yield from self._block(tree, "body", _Place("", tree))

    def _block(self, owner: ast.AST, field: str, place: _Place) -> Iterator[_Edit]:
        """Edits in a list of statements."""
        statements: list[ast.stmt] = getattr(owner, field)
        assigned: set[str] = set()
        for index, statement in enumerate(statements):
            if _is_skipped(statement, top_level=not place.function):
                continue
            here = _Place(place.function, statement, place.in_kernel)
            if _may_be_dropped(statement, assigned):
                without = [*statements[:index], ast.Pass(), *statements[index + 1 :]]
                yield _Edit(here, "drop statement", owner, field, without)
            assigned |= _assigned_names(statement)
            if not isinstance(statement, ast.Raise):
                yield from self._statement(statement, here)

    def _statement(self, statement: ast.stmt, place: _Place) -> Iterator[_Edit]:
        if isinstance(statement, ast.FunctionDef | ast.ClassDef):
            yield from self._definition(statement, place)
            return
        if isinstance(statement, ast.Return) and statement.value is not None:
            yield from _return_edits(statement, statement.value, place)
        if isinstance(statement, ast.If | ast.While):
            yield from _test_edits(statement, statement.test, place)
        if isinstance(statement, ast.AugAssign) and type(statement.op) in ARITHMETIC:
            other = ARITHMETIC[type(statement.op)]()
            yield _Edit(place, "arithmetic", statement, "op", other)
        for field, value in ast.iter_fields(statement):
            if field == "annotation":
                continue
            if isinstance(value, ast.expr):
                yield from self._expression(value, statement, field, None, place)
            elif isinstance(value, list):
                yield from self._list(statement, field, value, place)

    def _definition(
        self, definition: ast.FunctionDef | ast.ClassDef, place: _Place
    ) -> Iterator[_Edit]:
        if definition.name in SKIPPED_FUNCTIONS:
            return
        name = f"{place.function}.{definition.name}".lstrip(".")
        in_kernel = place.in_kernel or bool(KERNEL_DECORATORS & _decorators(definition))
        if isinstance(definition, ast.FunctionDef):
            yield from self._children(definition.args, _Place(name, definition, in_kernel))
        yield from self._block(definition, "body", _Place(name, definition, in_kernel))

    def _list(self, owner: ast.AST, field: str, items: list[Any], place: _Place) -> Iterator[_Edit]:
        if items and isinstance(items[0], ast.stmt):
            yield from self._block(owner, field, place)
            return
        for index, item in enumerate(items):
            if isinstance(item, ast.ExceptHandler):
                yield from self._block(item, "body", place)
            elif isinstance(item, ast.match_case):
                here = _Place(place.function, item, place.in_kernel)
                if item.guard:
                    yield from self._expression(item.guard, item, "guard", None, here)
                yield from self._block(item, "body", place)
            elif isinstance(item, ast.expr):
                yield from self._expression(item, owner, field, index, place)
            elif isinstance(item, ast.AST):
                yield from self._children(item, place)

    def _children(self, node: ast.AST, place: _Place) -> Iterator[_Edit]:
        for field, value in ast.iter_fields(node):
            if field == "annotation":
                continue
            if isinstance(value, ast.expr):
                yield from self._expression(value, node, field, None, place)
            elif isinstance(value, list):
                yield from self._list(node, field, value, place)

    def _expression(
        self, node: ast.expr, owner: ast.AST, field: str, index: int | None, place: _Place
    ) -> Iterator[_Edit]:
        """Edits of an expression and of what is in it; `owner` holds it in `field` (at `index`)."""
        if isinstance(node, ast.JoinedStr):
            return
        if isinstance(node, ast.Call) and _called(node) in {"field", "cast", "TypeVar"}:
            return
        yield from self._operator_edits(node, place)
        if isinstance(node, ast.UnaryOp) and not isinstance(node.op, ast.UAdd):
            value: Any = node.operand
            if index is not None:
                value = list(getattr(owner, field))
                value[index] = node.operand
            yield _Edit(place, "drop sign or not", owner, field, value)
        yield from self._children(node, place)

    def _operator_edits(self, node: ast.expr, place: _Place) -> Iterator[_Edit]:
        if isinstance(node, ast.Compare):
            for index, operator in enumerate(node.ops):
                for other in COMPARISONS[type(operator)]:
                    ops = [*node.ops[:index], other(), *node.ops[index + 1 :]]
                    yield _Edit(place, "comparison", node, "ops", ops)
        elif isinstance(node, ast.BoolOp):
            swapped = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            yield _Edit(place, "and / or", node, "op", swapped)
        elif isinstance(node, ast.BinOp) and type(node.op) in ARITHMETIC:
            if place.function or not isinstance(node.op, ast.BitOr):  # else a union of types
                yield _Edit(place, "arithmetic", node, "op", ARITHMETIC[type(node.op)]())
        elif isinstance(node, ast.IfExp):
            yield from _test_edits(node, node.test, place)
        elif isinstance(node, ast.Constant):
            value = _other_constant(node.value)
            if value is not None:
                yield _Edit(place, "constant", node, "value", value)
        elif isinstance(node, ast.Call):
            yield from self._call_edits(node, place)

    def _call_edits(self, call: ast.Call, place: _Place) -> Iterator[_Edit]:
        name = _called(call)
        if name in OPPOSITES:
            field = "id" if isinstance(call.func, ast.Name) else "attr"
            yield _Edit(place, "min / max", call.func, field, OPPOSITES[name])
        for index, keyword in enumerate(call.keywords):
            optional = self.defaults.get(name)
            if keyword.arg is None or (optional is not None and keyword.arg not in optional):
                continue
            without = [*call.keywords[:index], *call.keywords[index + 1 :]]
            yield _Edit(place, "drop argument", call, "keywords", without)


def _return_edits(statement: ast.Return, value: ast.expr, place: _Place) -> Iterator[_Edit]:
    if isinstance(value, ast.Compare | ast.BoolOp):
        yield _Edit(place, "return", statement, "value", ast.UnaryOp(ast.Not(), value))
    elif isinstance(value, ast.Constant):
        return
    elif not place.in_kernel:  # a kernel that returns None does not compile
        yield _Edit(place, "return", statement, "value", ast.Constant(None))


def _test_edits(owner: ast.AST, test: ast.expr, place: _Place) -> Iterator[_Edit]:
    """Negate a condition that has no operator of its own."""
    if isinstance(test, ast.Name | ast.Attribute | ast.Call | ast.Subscript):
        yield _Edit(place, "condition", owner, "test", ast.UnaryOp(ast.Not(), test))


def _other_constant(value: object) -> bool | int | float | None:
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value * 1.5 if value else 1.0
    return None


def _is_skipped(statement: ast.stmt, *, top_level: bool) -> bool:
    match statement:
        case ast.Import() | ast.ImportFrom() | ast.Assert() | ast.Pass():
            return True
        case ast.Expr(value=ast.Constant()):  # documentation
            return True
        case ast.Expr(value=ast.Call(func=ast.Attribute(value=ast.Name(id=name)))):
            return name in LOGGERS
        case ast.Assign(targets=[ast.Name(id=name)]) if top_level:
            return name.startswith("__") or name in LOGGERS
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
    return False


def _may_be_dropped(statement: ast.stmt, assigned: set[str]) -> bool:
    """Whether the module still runs without it: not where a name would stay undefined."""
    match statement:
        case ast.AugAssign() | ast.Raise() | ast.Continue() | ast.Break() | ast.Delete():
            return True
        case ast.Expr(value=ast.Call()):
            return True
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            return True
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name in assigned
    return False


def _assigned_names(statement: ast.stmt) -> set[str]:
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        names = (node for node in ast.walk(statement) if isinstance(node, ast.Name))
        return {node.id for node in names if isinstance(node.ctx, ast.Store)}
    return set()


def _decorators(definition: ast.FunctionDef | ast.ClassDef) -> set[str]:
    called = (one.func if isinstance(one, ast.Call) else one for one in definition.decorator_list)
    return {ast.unparse(one).rpartition(".")[2] for one in called}


def _called(call: ast.Call) -> str:
    """Last name of what is called: ``min`` for ``np.min(x)`` and for ``x.min()``."""
    match call.func:
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name
    return ""


def _line(statement: ast.AST) -> int:
    if isinstance(statement, ast.match_case):
        return statement.pattern.lineno
    line: int = getattr(statement, "lineno", 1)
    return line


def _shown(statement: ast.AST) -> str:
    """A simple statement, or the first line of a compound one, on one line."""
    text = ast.unparse(statement)
    if hasattr(statement, "body") or hasattr(statement, "cases"):
        decorators = len(getattr(statement, "decorator_list", ()))
        text = text.strip().splitlines()[decorators]
    return re.sub(r"\s+", " ", text)


def _shortened(before: str, after: str) -> tuple[str, str]:
    """Both texts without what is the same far from the change."""
    length = min(len(before), len(after))
    same = next((k for k in range(length) if before[k] != after[k]), length)
    rest = length - same
    tail = next((k for k in range(rest) if before[-1 - k] != after[-1 - k]), rest)
    start = same - CONTEXT if same > CONTEXT + 10 else 0

    def cut(text: str) -> str:
        stop = len(text) - tail + CONTEXT
        end = "" if stop + 10 >= len(text) else " ..."
        return ("... " if start else "") + text[start : stop if end else None] + end

    return cut(before), cut(after)


def _told_apart(found: list[Mutation]) -> list[Mutation]:
    """Number the mutations of one function that read the same."""
    times: Counter[str] = Counter()
    numbered = []
    for one in found:
        times[one.name] += 1
        number = times[one.name]
        mutated = one.mutated if number == 1 else f"{one.mutated} [{number}]"
        numbered.append(
            Mutation(one.function, one.line, one.operator, one.original, mutated, one.source)
        )
    return numbered
