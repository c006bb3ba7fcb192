"""The errors: each a small change of one place in a module, spelled as its syntax tree."""

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

SWAPPED = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div, ast.Mod: ast.Mult, ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}  # fmt: skip
_PAIRS = "min max,minimum maximum,argmin argmax,any all,floor ceil,zeros ones"
RENAMED = {a: b for pair in _PAIRS.split(",") for a, b in (pair.split(), pair.split()[::-1])}
# Arguments that only make something faster, or say where a warning comes from.
IDLE = {
    "assume_unique",
    "check_finite",
    "copy",
    "overwrite_a",
    "overwrite_b",
    "stacklevel",
    "strict",
}
CHANGED = ast.FunctionDef | ast.ClassDef | ast.Assign  # at the top of a module


@dataclass(frozen=True)
class Place:
    """Where a change is: the function, lines of the statement, and what it was and has become."""

    function: str  # "" for what runs at import
    first: int
    last: int
    text: str
    at_import: bool  # whether it runs then: a constant, or what an argument is by default

    @property
    def lines(self) -> range:
        """The lines of the statement."""
        return range(self.first, self.last + 1)


def changes(source: str, kernels: bool) -> Iterator[tuple[Place, ast.Module]]:
    """Yield every change of a module with the changed tree, which is good until the next.

    Of what Numba compiles, or of the rest.
    """
    tree = ast.parse(source)
    wanted = [one for one in tree.body if _compiled(one, tree) == kernels]
    if not kernels:
        wanted = [one for one in wanted if isinstance(one, CHANGED)]
    for function, statement, holder, name, index, node in list(_sites(tree, "", None, wanted)):
        before, lines = _header(statement), _lines(statement)
        at_import = not function or isinstance(statement, ast.FunctionDef)
        for new in _instead(node, name):
            _put(holder, name, index, new)
            removed = node is statement
            after = ast.unparse(new) if removed else _header(statement)
            text = f"{{{before} => {after}}}" if removed else _difference(before, after)
            if after != before:
                place = Place(function, *lines, text, at_import)
                yield place, ast.fix_missing_locations(tree)
            _put(holder, name, index, node)


def _compiled(statement: ast.stmt, tree: ast.Module) -> bool | None:
    """Whether Numba compiles a function, or one inside it; None if it makes code itself."""
    imports = [one for one in tree.body if isinstance(one, ast.ImportFrom)]
    known = {a.name for one in imports if one.module == "unbend._compiled" for a in one.names}
    used = {one.id for one in ast.walk(statement) if isinstance(one, ast.Name)} & known
    is_function = isinstance(statement, ast.FunctionDef)
    return None if "generated" in used else is_function and bool(used & {"compiled"})


def _sites(
    node: ast.AST, function: str, statement: ast.AST | None, wanted: list[ast.stmt]
) -> Iterator[tuple[str, ast.AST, ast.AST, str, int | None, ast.AST]]:
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_comment"):
            continue
        for index, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(child, ast.AST) or _is_idle(node, child):
                continue
            if isinstance(node, ast.Module) and child not in wanted:
                continue
            own = isinstance(child, ast.stmt | ast.match_case | ast.excepthandler)
            of, inside = child if own else statement, function
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                inside = f"{function}.{child.name}".lstrip(".")
            yield inside, of, node, name, index, child
            if not isinstance(child, ast.Raise):
                yield from _sites(child, inside, of, wanted)


def _is_idle(parent: ast.AST, node: ast.AST) -> bool:
    """Whether no run of the program could tell: types, fields of records, what is only for show."""
    if isinstance(node, ast.JoinedStr | ast.Assert):
        return True
    if isinstance(parent, ast.ClassDef):
        return not isinstance(node, ast.FunctionDef)
    if isinstance(parent, ast.Call) and ast.unparse(parent.func).endswith("reshape"):
        return isinstance(node, ast.UnaryOp)  # to NumPy, -2 is -1 there
    return isinstance(node, ast.keyword) and node.arg in IDLE


def _instead(node: ast.AST, name: str) -> Iterator[ast.AST]:
    """Yield what could stand by mistake in the place of a node, a field of this name."""
    new = copy.deepcopy(node)
    if name == "test" and not _negated(node):
        yield ast.UnaryOp(ast.Not(), node)
    match new:
        case ast.operator() | ast.cmpop() | ast.boolop() if type(node) in SWAPPED:
            yield SWAPPED[type(node)]()
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert(), operand=operand):
            yield operand
        case ast.comprehension(ifs=[_, *_]):
            new.ifs = []
            yield new
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            yield ast.Constant(value * 2 or 1.0)
        case ast.Return(value=value) if value and ast.unparse(value) not in ("None", "False"):
            yield ast.Return(None)
        case ast.Name(id=name) if name in RENAMED:
            new.id = RENAMED[name]
            yield new
        case ast.Attribute(attr=name) if name in RENAMED:
            new.attr = RENAMED[name]
            yield new
        case ast.Call(args=args, keywords=keywords):
            called = ast.unparse(new.func).split(".")[-1]
            if (
                len(args) > 1
                and called not in RENAMED
                and not any(isinstance(one, ast.Starred) for one in args[:2])
            ):
                yield ast.Call(new.func, [args[1], args[0], *args[2:]], keywords)
            for i, one in enumerate(keywords):
                if one.arg not in IDLE:
                    yield ast.Call(new.func, args, keywords[:i] + keywords[i + 1 :])
        case ast.Raise() | ast.AugAssign() | ast.Break():
            yield ast.Pass()
        case ast.Continue():
            yield ast.Break()
        case ast.Expr(value=ast.Call() | ast.YieldFrom()):
            yield ast.Pass()
        case ast.Assign(targets=[target], value=value):
            read = {one.id for one in ast.walk(value) if isinstance(one, ast.Name)}
            if not isinstance(target, ast.Name | ast.Tuple) or getattr(target, "id", "") in read:
                yield ast.Pass()


def _negated(test: ast.AST) -> bool:
    """Whether another change says the contrary."""
    two_ways = ast.Eq | ast.NotEq | ast.Is | ast.IsNot | ast.In | ast.NotIn
    compared = isinstance(test, ast.Compare) and isinstance(test.ops[0], two_ways)
    return compared or isinstance(test, ast.UnaryOp)


def _put(holder: ast.AST, name: str, index: int | None, new: ast.AST) -> None:
    if index is None:
        setattr(holder, name, new)
    else:
        getattr(holder, name)[index] = new


def _header(statement: ast.AST) -> str:
    """A statement without those inside it, in one line."""
    lines = [line for line in ast.unparse(statement).split("\n") if not line.startswith("@")]
    return lines[0] if _body(statement) else "\n".join(lines)


def _lines(statement: ast.AST) -> tuple[int, int]:
    first = getattr(statement, "lineno", 0) or statement.pattern.lineno
    body = [] if isinstance(statement, ast.FunctionDef) else _body(statement)
    first -= isinstance(statement, ast.Continue)  # which is part of the line before, when it runs
    return first, max(first, body[0].lineno - 1 if body else statement.end_lineno)


def _body(statement: ast.AST) -> list[ast.stmt]:
    cases = getattr(statement, "cases", None)
    return cases[0].body if cases else getattr(statement, "body", [])


def _difference(before: str, after: str) -> str:
    """Both in one, and what is around: ``n {< => <=} 3``."""
    start = _shared(before, after)
    end = _shared(before[start:][::-1], after[start:][::-1])
    while start and before[start - 1] not in " ([":
        start -= 1
    while end and before[len(before) - end] not in " )],:":
        end -= 1
    old, new = (text[start : len(text) - end] for text in (before, after))
    return (
        f"{before[max(0, start - 50) : start]}{{{old} => {new}}}{before[len(before) - end :][:30]}"
    )


def _shared(one: str, other: str) -> int:
    """How many letters are the same from the start."""
    pairs = enumerate(zip(one, other, strict=False))
    return next((i for i, (a, b) in pairs if a != b), min(len(one), len(other)))
