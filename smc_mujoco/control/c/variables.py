"""The variables of a function in C: their names, their kinds, and where they are declared."""

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence

from smc_mujoco.control.c.calls import MATH
from smc_mujoco.control.c.values import POINTERS, TYPES, Value, plain, refuse, wider

KEYWORDS = """auto break case char const continue default do double else enum extern float for goto if inline int long
register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while"""
# What headers, newer C and compilers' own dialects have: functions, macros, keywords.
OTHERS = """_Bool _Complex _Imaginary alignas alignof asm bool constexpr false linux nullptr static_assert thread_local
true typeof unix main abort abs exit free index labs rindex NAN INFINITY HUGE_VAL cbrt drem erf erfc exp2 exp10 fdim
finite fma fmax fmin fpclassify frexp gamma ilogb isfinite isgreater isgreaterequal isinf isless islessequal
islessgreater isnan isnormal isunordered j0 j1 jn ldexp lgamma llrint llround logb lrint lround modf nan nearbyint
nextafter nexttoward pow10 remainder remquo rint round scalb scalbln scalbn signbit signgam significand tgamma y0 y1
yn"""
TAKEN = {*KEYWORDS.split(), *OTHERS.split(), *MATH, "out"}


def named(nodes: Iterable[ast.AST]) -> set[str]:
    """The names in some code."""
    return {n.id for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name)}


def stored(nodes: Iterable[ast.AST]) -> set[str]:
    """The names of what some code changes: variables, and arrays of which it changes an element."""
    inside = [n for node in nodes for n in ast.walk(node) if isinstance(getattr(n, "ctx", None), ast.Store)]
    return named(n.value if isinstance(n, ast.Subscript) else n for n in inside)


def ends(body: Sequence[ast.stmt]) -> bool:
    """Whether some code always ends in a return."""
    match body[-1]:
        case ast.If(body=yes, orelse=no):
            return bool(no) and ends(yes) and ends(no)
        case last:
            return isinstance(last, ast.Return)


class Variables:
    """The parameters and variables of a function; `constants` are parameters that are literal numbers instead."""

    def __init__(self, tree: ast.FunctionDef, kinds: Sequence[str], constants: Mapping[str, float], law: bool):
        self.law, self.constants = law, dict(constants)
        arguments = [a.arg for a in tree.args.args]
        if len(arguments) != len(kinds) or tree.args.vararg or tree.args.kwonlyargs or tree.args.kwarg:
            raise refuse(None, f"{tree.name} with its arguments")
        if not ends(tree.body):
            raise refuse(None, f"{tree.name}, whose last line is no return,")
        self.parameters = {n: k for n, k in zip(arguments, kinds, strict=True) if n not in constants}
        self.kinds = dict(self.parameters)
        inside = [node for statement in tree.body for node in ast.walk(statement)]
        self.read = {n.id for n in inside if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        self.restart()

    def restart(self) -> None:
        """Forget what was declared, but not the kinds that were found."""
        self.declared, self.late = set(self.parameters), set[str]()
        self.names = {name: Value(self.name(name), kind) for name, kind in self.kinds.items()}

    def name(self, name: str) -> str:
        """A variable's name in C; a law's arguments have those of smc_law.h."""
        if self.law and self.kinds.get(name) in POINTERS:
            return self.kinds[name]
        return plain(name) + "_" * (name in TAKEN or (self.law and name in POINTERS))

    def target(self, name: str, kind: str, top: bool) -> str:
        """A variable that gets a value of a kind, after its type where `top` lets it be declared here."""
        if self.kinds.get(name) in POINTERS or name in self.constants:
            raise refuse(ast.Name(name), "an assignment to this")
        self.kinds[name] = kind = wider(self.kinds.get(name, kind), kind)
        self.names[name] = Value(self.name(name), kind)
        if name not in self.declared | self.late:
            (self.declared if top else self.late).add(name)
            return f"{TYPES[kind]} {self.name(name)}" if top else self.name(name)
        return self.name(name)

    def counter(self, name: str) -> str:
        """The variable of a loop, which lives in it alone."""
        if name in self.declared | self.late:
            raise refuse(ast.Name(name), "a loop over a variable that there is already")
        self.names[name] = Value(self.name(name), "int")
        return self.name(name)

    def silent(self, targets: Sequence[ast.expr], indent: str, top: bool) -> Iterator[str]:
        """Lines for variables declared here that nothing reads, for which compilers warn."""
        for target in targets if top else ():
            if isinstance(target, ast.Name) and target.id not in self.read:
                yield f"{indent}(void){self.name(target.id)};"

    def opening(self) -> list[str]:
        """Lines that declare what is not declared where it first gets a value, and that name what nothing reads."""
        late = sorted(self.late)
        lines = [f"    {TYPES[self.kinds[n]]} {self.name(n)} = 0;" for n in late]
        return lines + [f"    (void){self.name(n)};" for n in (*self.parameters, *late) if n not in self.read]
