"""From the part of Python in which effects and the plant's loop are written to C99.

Scalars are doubles, or longs where only whole numbers go in; arrays are pointers with a length. What is known
beforehand, such as which effects are on, is folded away. Several return values leave by pointers.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from ..errors import EffectError

MATH = frozenset(
    {
        *("sqrt", "exp", "log", "log1p", "expm1", "pow", "hypot", "floor", "ceil", "fabs", "copysign", "isfinite"),
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "erf", "erfc"),
    }
)
"""Functions of `math` that C has under the same name."""
_OPERATORS: dict[type, str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=", ast.And: "&&", ast.Or: "||", ast.USub: "-", ast.UAdd: "+", ast.Not: "!",
}  # fmt: skip
_KEYWORDS = frozenset(
    word
    for line in (
        "auto break case char const continue default do double else enum extern float for goto if inline int long main",
        "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while",
    )
    for word in line.split()
)
BUILTINS = frozenset({"min", "max", "abs", "int", "float", "len", "range"})
_WHOLE, _REAL = "long", "double"
_LARGEST_POWER = 8


@dataclass
class Function:
    """A function to translate: its tree, the name that it has in C, and what its free names mean.

    ``scope`` gives numbers, modules, and the C names of other functions as `Called`. ``arrays`` are the arguments that
    are arrays, ``known`` arguments or elements of them whose value is known (``on[3]`` → 1) and which C does not take.
    """

    name: str
    tree: ast.FunctionDef
    scope: Mapping[str, Any]
    where: str
    known: Mapping[str, float] = field(default_factory=dict)
    arrays: frozenset[str] = frozenset()
    whole: frozenset[str] = frozenset()
    returns: int = 1
    result: str = _REAL


@dataclass(frozen=True)
class Called:
    """Another function as a call sees it: its C name, which arguments are arrays, and how many values it returns."""

    name: str
    arrays: tuple[bool, ...]
    returns: int


def c_name(name: str) -> str:
    """The name in C: its own, unless C keeps that for itself."""
    return f"{name}_" if name in _KEYWORDS else name


def number(value: float) -> str:
    """A number as C writes it, every digit kept."""
    if isinstance(value, int):
        return str(int(value))  # True is 1
    if not math.isfinite(value):
        return "INFINITY" if value > 0 else "-INFINITY" if value < 0 else "NAN"
    return repr(float(value))


class Translator:
    """Translates one function."""

    def __init__(self, function: Function) -> None:
        self.f = function
        self.types: dict[str, str] = {}
        self.sizes: dict[str, str] = {}
        self.known: dict[str, float] = dict(function.known)
        self.lines: list[str] = []
        self.depth = 1
        self.once = _assigned_once(function.tree)

    def text(self) -> str:
        """The function in C."""
        names = [a.arg for a in self.f.tree.args.args]
        known = {key.partition("[")[0] for key in self.known}
        kept = [n for n in names if n not in known]
        for name in kept:
            if name in self.f.arrays:
                self.sizes[name] = f"n_{name}"
            else:
                self.types[name] = _WHOLE if name in self.f.whole else _REAL
        arguments = set(kept)
        while True:
            before = dict(self.types)
            self._infer(self.f.tree.body)
            if before == self.types:
                break
        self._block(self.f.tree.body)
        head = [
            f"double *{c_name(n)}, long n_{n}" if n in self.f.arrays else f"{self.types[n]} {c_name(n)}" for n in kept
        ]
        head += [f"double *out_{i}" for i in range(self.f.returns)] if self.f.returns > 1 else []
        kind = "void" if self.f.returns != 1 else self.f.result
        unused = "".join(f"    (void){c_name(n)};{f' (void)n_{n};' if n in self.f.arrays else ''}\n" for n in kept)
        local = [n for n in self.types if n not in arguments]
        declared = "".join(f"    {self.types[n]} {c_name(n)} = 0; (void){c_name(n)};\n" for n in local)
        body = "\n".join(self.lines)
        return f"static {kind} {self.f.name}({', '.join(head)})\n{{\n{unused}{declared}{body}\n}}\n"

    def fail(self, node: ast.AST, what: str) -> EffectError:
        """The error that something has no translation."""
        return EffectError(f"{self.f.where}, line {getattr(node, 'lineno', '?')}: {what} cannot be written in C")

    # Types: a variable is whole where all that goes into it is.

    def _infer(self, body: Sequence[ast.stmt]) -> None:
        for node in body:
            for one in ast.walk(node):
                if isinstance(one, ast.Assign):
                    for target in one.targets:
                        self._assigned(target, one.value)
                elif isinstance(one, ast.AugAssign) and isinstance(one.target, ast.Name):
                    self._join(one.target.id, _REAL if isinstance(one.op, ast.Div) else self._type(one.value))
                elif isinstance(one, ast.For) and isinstance(one.target, ast.Name):
                    self._join(one.target.id, _WHOLE)

    def _assigned(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            values = value.elts if isinstance(value, ast.Tuple) else [None] * len(target.elts)
            for one, part in zip(target.elts, values, strict=True):
                if isinstance(one, ast.Name):
                    self._join(one.id, _REAL if part is None else self._type(part))
        elif isinstance(target, ast.Name):
            if self._array_size(value) is not None:
                self.sizes[target.id] = str(self._array_size(value))
            else:
                self._join(target.id, self._type(value))

    def _join(self, name: str, kind: str) -> None:
        self.types[name] = _REAL if _REAL in (kind, self.types.get(name)) else _WHOLE

    def _type(self, node: ast.expr) -> str:
        if isinstance(node, ast.Constant):
            return _REAL if isinstance(node.value, float) else _WHOLE
        if isinstance(node, ast.Name):
            value = self.f.scope.get(node.id)
            if node.id not in self.types and isinstance(value, int | float):
                return _WHOLE if isinstance(value, int) else _REAL
            return self.types.get(node.id, _WHOLE)
        if isinstance(node, ast.BinOp):
            both = {self._type(node.left), self._type(node.right)}
            return _REAL if _REAL in both or isinstance(node.op, ast.Div | ast.Pow) else _WHOLE
        if isinstance(node, ast.UnaryOp):
            return self._type(node.operand)
        if isinstance(node, ast.Compare | ast.BoolOp):
            return _WHOLE
        if isinstance(node, ast.IfExp):
            return _REAL if _REAL in (self._type(node.body), self._type(node.orelse)) else _WHOLE
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id in ("int", "len"):
                return _WHOLE
            if node.func.id in ("min", "max", "abs"):
                return _REAL if any(self._type(a) == _REAL for a in node.args) else _WHOLE
        return _REAL

    def _array_size(self, node: ast.expr) -> str | None:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("empty", "zeros"):
            return self.expression(node.args[0])
        return None

    # Statements.

    def _line(self, text: str) -> None:
        self.lines.append("    " * self.depth + text)

    def _block(self, body: Sequence[ast.stmt]) -> None:
        for node in body:
            self._statement(node)

    def _nested(self, body: Sequence[ast.stmt]) -> None:
        self.depth += 1
        self._block(body)
        self.depth -= 1

    def _statement(self, node: ast.stmt) -> None:
        if isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)):
            return
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            self._assign(node.targets[0], node.value)
        elif isinstance(node, ast.AugAssign):
            if not isinstance(node.op, ast.Add | ast.Sub | ast.Mult | ast.Div):
                raise self.fail(node, f"the operator {type(node.op).__name__}")
            self._line(f"{self.place(node.target)} {_OPERATORS[type(node.op)]}= {self.expression(node.value)};")
        elif isinstance(node, ast.Return):
            self._return(node)
        elif isinstance(node, ast.If):
            self._if(node)
        elif isinstance(node, ast.While) and not node.orelse:
            self._line(f"while ({self.expression(node.test)}) {{")
            self._nested(node.body)
            self._line("}")
        elif isinstance(node, ast.For):
            self._for(node)
        elif isinstance(node, ast.Break | ast.Continue):
            self._line("break;" if isinstance(node, ast.Break) else "continue;")
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            self._line(f"{self.expression(node.value)};")
        else:
            raise self.fail(node, f"the statement {type(node).__name__}")

    def _if(self, node: ast.If) -> None:
        value = self.constant(node.test)
        if value is not None:
            self._block(node.body if value else node.orelse)
            return
        self._line(f"if ({self.expression(node.test)}) {{")
        self._nested(node.body)
        if node.orelse:
            self._line("} else {")
            self._nested(node.orelse)
        self._line("}")

    def _for(self, node: ast.For) -> None:
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"
                and len(call.args) in (1, 2) and isinstance(node.target, ast.Name) and not node.orelse):  # fmt: skip
            raise self.fail(node, "a loop over something else than range")
        low = "0" if len(call.args) == 1 else self.expression(call.args[0])
        # As in Python, the body changes neither how often it runs nor what comes next.
        self._line(f"for (long next_ = {low}, end_ = {self.expression(call.args[-1])}; next_ < end_; next_++) {{")
        self._line(f"    {c_name(node.target.id)} = next_;")
        self._nested(node.body)
        self._line("}")

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Tuple):
            self._several(target, value)
            return
        if isinstance(target, ast.Name):
            size = self._array_size(value)
            if size is not None:
                self._line(f"double {c_name(target.id)}[{size}] = {{0}};")
                return
            folded = self.constant(value)
            if folded is not None and target.id in self.once:
                self.known[target.id] = folded
                return
        self._line(f"{self.place(target)} = {self.expression(value)};")

    def _several(self, target: ast.Tuple, value: ast.expr) -> None:
        places = [self.place(t) for t in target.elts]
        if isinstance(value, ast.Tuple):
            parts = [self.expression(v) for v in value.elts]
            self._line("{")
            self._line("".join(f"double part{i}_ = {p}; " for i, p in enumerate(parts)))
            self._line("".join(f"{p} = part{i}_; " for i, p in enumerate(places)) + "}")
            return
        called = self._called(value)
        if called is None or called.returns != len(places):
            raise self.fail(value, f"an assignment to {len(places)} names from something else than a call or a tuple")
        assert isinstance(value, ast.Call)
        self._line(f"{called.name}({', '.join([*self._arguments(value, called), *(f'&{p}' for p in places)])});")

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            self._line("return;")
        elif self.f.returns > 1:
            if not isinstance(node.value, ast.Tuple) or len(node.value.elts) != self.f.returns:
                called = self._called(node.value)
                if called is None or called.returns != self.f.returns:
                    raise self.fail(node, f"a return of something else than {self.f.returns} values")
                assert isinstance(node.value, ast.Call)
                outs = [f"out_{i}" for i in range(self.f.returns)]
                self._line(f"{called.name}({', '.join([*self._arguments(node.value, called), *outs])}); return;")
                return
            parts = [self.expression(v) for v in node.value.elts]
            values = "".join(f"double part{i}_ = {p}; " for i, p in enumerate(parts))
            outs_text = "".join(f"*out_{i} = part{i}_; " for i in range(len(parts)))
            self._line(f"{{ {values}{outs_text}return; }}")
        else:
            self._line(f"return {self.expression(node.value)};")

    # Expressions.

    def place(self, node: ast.expr) -> str:
        """Something that can be assigned to."""
        if isinstance(node, ast.Name):
            return c_name(node.id)
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            if isinstance(node.slice, ast.Tuple):  # the outputs: one row for each sample
                row, column = (self.expression(e) for e in node.slice.elts)
                return f"{c_name(node.value.id)}[({row}) * NY + {column}]"
            return f"{c_name(node.value.id)}[{self.expression(node.slice)}]"
        raise self.fail(node, "this place")

    def constant(self, node: ast.expr) -> float | None:
        """The value of an expression that is known beforehand, else None."""
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int):
            return float(node.value)
        if isinstance(node, ast.Name | ast.Subscript):
            return self.known.get(ast.unparse(node))
        if isinstance(node, ast.Compare) and len(node.ops) == 1 and isinstance(node.ops[0], ast.NotEq):
            left, right = self.constant(node.left), self.constant(node.comparators[0])
            return None if left is None or right is None else float(left != right)
        if isinstance(node, ast.BoolOp):
            parts = [self.constant(v) for v in node.values]
            decisive = isinstance(node.op, ast.Or)
            if any(p is not None and bool(p) is decisive for p in parts):
                return float(decisive)
            return None if None in parts else float(not decisive)
        return None

    def expression(self, node: ast.expr) -> str:
        """An expression in C, in brackets where it needs some."""
        known = self.constant(node)
        if known is not None and not isinstance(node, ast.Constant):
            return str(int(known))
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            return number(int(node.value) if isinstance(node.value, bool) else node.value)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.Subscript):
            return self.place(node)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            value = getattr(self.f.scope.get(node.value.id), node.attr, None)
            if isinstance(value, int | float):
                return number(float(value))
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATORS:
            return f"({_OPERATORS[type(node.op)]}{self.expression(node.operand)})"
        if isinstance(node, ast.BoolOp):
            left = [v for v in node.values if self.constant(v) is None]
            return f"({f' {_OPERATORS[type(node.op)]} '.join(self.expression(v) for v in left)})"
        if isinstance(node, ast.Compare) and all(type(op) in _OPERATORS for op in node.ops):
            sides = [node.left, *node.comparators]
            pairs = zip(sides, node.ops, sides[1:], strict=False)
            parts = [f"{self.expression(a)} {_OPERATORS[type(op)]} {self.expression(b)}" for a, op, b in pairs]
            return f"({' && '.join(parts)})"
        if isinstance(node, ast.IfExp):
            value = self.constant(node.test)
            if value is not None:
                return self.expression(node.body if value else node.orelse)
            test, yes, no = (self.expression(e) for e in (node.test, node.body, node.orelse))
            return f"({test} ? {yes} : {no})"
        if isinstance(node, ast.Call):
            return self._call(node)
        raise self.fail(node, f"{ast.unparse(node)!r}")

    def _name(self, node: ast.Name) -> str:
        if node.id in self.types or node.id in self.sizes:
            return c_name(node.id)
        value = self.f.scope.get(node.id)
        if isinstance(value, int | float):
            return number(value)
        raise self.fail(node, f"the name {node.id!r}")

    def _binary(self, node: ast.BinOp) -> str:
        left, right = self.expression(node.left), self.expression(node.right)
        if isinstance(node.op, ast.Pow):
            power = node.right
            if isinstance(power, ast.Constant) and isinstance(power.value, int) and 0 < power.value <= _LARGEST_POWER:
                return f"({' * '.join([left] * power.value)})"
            return f"pow({left}, {right})"
        if isinstance(node.op, ast.Mod):
            whole = self._type(node.left) == self._type(node.right) == _WHOLE
            return f"{'whole_' if whole else ''}modulo({left}, {right})"
        if isinstance(node.op, ast.Div):
            return f"({left} / (double){right})"
        if type(node.op) not in _OPERATORS:
            raise self.fail(node, f"the operator {type(node.op).__name__}")
        return f"({left} {_OPERATORS[type(node.op)]} {right})"

    def _called(self, node: ast.expr) -> Called | None:
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            found = self.f.scope.get(node.func.id)
            return found if isinstance(found, Called) else None
        return None

    def _call(self, node: ast.Call) -> str:
        if node.keywords:
            raise self.fail(node, "a call with named arguments")
        called = self._called(node)
        if called is not None:
            return f"{called.name}({', '.join(self._arguments(node, called))})"
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name):
            module = self.f.scope.get(node.func.value.id)
            if isinstance(module, ModuleType) and module.__name__ == "math" and node.func.attr in MATH:
                return f"{node.func.attr}({', '.join(self.expression(a) for a in node.args)})"
        if isinstance(node.func, ast.Name):
            arguments = [] if node.func.id == "len" else [self.expression(a) for a in node.args]
            if node.func.id == "len" and isinstance(node.args[0], ast.Name):
                return self.sizes[node.args[0].id]
            if node.func.id == "int":
                return f"((long)({arguments[0]}))"
            if node.func.id == "float":
                return f"((double)({arguments[0]}))"
            if node.func.id == "abs":
                return f"fabs({arguments[0]})"
            if node.func.id in ("min", "max") and len(arguments) > 1:
                text = arguments[0]
                for other in arguments[1:]:
                    text = f"{'smaller' if node.func.id == 'min' else 'larger'}({text}, {other})"
                return text
        raise self.fail(node, f"the call {ast.unparse(node)!r} (allowed: math, min, max, abs, int, own functions)")

    def _arguments(self, node: ast.Call, called: Called) -> list[str]:
        found: list[str] = []
        for argument, is_array in zip(node.args, called.arrays, strict=True):
            found += self._array(argument) if is_array else [self.expression(argument)]
        return found

    def _array(self, node: ast.expr) -> list[str]:
        if isinstance(node, ast.Name) and node.id in self.sizes:
            return [c_name(node.id), self.sizes[node.id]]
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Slice):
            low, high = node.slice.lower, node.slice.upper
            ends = [e.value for e in (low, high) if isinstance(e, ast.Constant) and isinstance(e.value, int)]
            if len(ends) == 2:
                return [f"{c_name(node.value.id)} + {ends[0]}", str(ends[1] - ends[0])]
        raise self.fail(node, f"the array {ast.unparse(node)!r}")


def _assigned_once(tree: ast.FunctionDef) -> frozenset[str]:
    """Names that are set in one place only, and are no arguments."""
    stored = [n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)]
    return frozenset(n for n in stored if stored.count(n) == 1) - {a.arg for a in tree.args.args}


def tree_of(text: str, name: str) -> ast.FunctionDef:
    """The definition of a function in a text."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return node
    raise EffectError(f"no function {name} in the text")


def arrays_of(tree: ast.FunctionDef, scope: Mapping[str, Any]) -> frozenset[str]:
    """Arguments that are arrays: those with an index or a length, or that are handed on as arrays."""
    names = {a.arg for a in tree.args.args}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
            found.add(node.value.id)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            called = scope.get(node.func.id)
            if node.func.id == "len" and isinstance(node.args[0], ast.Name):
                found.add(node.args[0].id)
            for argument, is_array in zip(node.args, called.arrays if isinstance(called, Called) else (), strict=False):
                if is_array and isinstance(argument, ast.Name):
                    found.add(argument.id)
    return frozenset(found & names)
