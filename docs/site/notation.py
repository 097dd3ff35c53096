"""The plain notation of docstrings as LaTeX:

`u = -k1 [s]^(1/2) + w`, also in the middle of a sentence.

What the notation means: `k1` is k with index 1, `w_max` has a word as index, `x_(i+1)` an
expression; `de` is e'; the field's brackets in `[s]^p` mean |s|^p sgn(s); `a / b` with spaces is a
fraction, `a/b` is not; `d^` has a hat, `w+` is the next value, `u_` the last one.
"""

import re
from collections.abc import Collection, Iterator
from typing import NamedTuple

GREEK = {
    "lam": r"\lambda",
    "gamma": r"\gamma",
    "phi": r"\varphi",
    "eps": r"\varepsilon",
    "sigma": r"\sigma",
    "mu": r"\mu",
    "tau": r"\tau",
    "alpha": r"\alpha",
    "beta": r"\beta",
    "delta": r"\delta",
    "pi": r"\pi",
}
FUNCTIONS = (
    "sgn",
    "sat",
    "tanh",
    "atanh",
    "sech",
    "sqrt",
    "min",
    "max",
    "sup",
    "exp",
    "ln",
    "cos",
    "sin",
)
SYMBOLS = {  # names of several letters
    "de": "e'",
    "dt": r"\Delta t",
    "dq": "q'",
    "ds": r"\delta s",
    "eq": r"v_{\mathrm{eq}}",
    "inf": r"\infty",
    "grav": r"\mathrm{grav}",
    "int": r"\int",
    "gq": "g_q",
    "fq": "f_q",
    "bq": "b_q",
    "kp": "k_p",
    "ki": "k_i",
    "kd": "k_d",
    "kc": "k_c",
    "tt": "t_t",
    "cf": "c_f",
    "cfq": "c_{fq}",
    "Jp": "J_p",
    "Jc": "J_c",
    "Ir": "I_r",
}
OPERATORS = {
    "<=": r"\le ",
    ">=": r"\ge ",
    "+-": r"\pm ",
    "->": r"\to ",
    ">>": r"\gg ",
    "~": r"\approx ",
    "..": r"\dots ",
    "+=": r"\mathrel{+}= ",
    "<": r"\lt ",
    ">": r"\gt ",
    "%": r"\%",
}
OPEN = {"(": ")", "[": "]", "{": "}"}
CLOSE = {")": "(", "]": "[", "}": "{"}
ARTICLES = ("a", "A", "I")
TOKEN = re.compile(
    r"""(?P<space>\s+)
    | (?P<code>`[^`]*`)
    | (?P<word>(?:[A-Z]\.\ ){2,}(?=[A-Z][a-z])
      |[A-Za-z]{2,}(?:_[A-Za-z]+)*'s\b|[A-Za-z]{2,}(?:-[A-Za-z]+)+
      |\d+-[a-z]{2,}(?:-[a-z]+)*|\d+(?:st|nd|rd|th)\b)
    | (?P<name>[A-Za-z]+\d*(?:_(?:[A-Za-z0-9]+|(?=\()))*(?:_(?![\w(]))?)
      (?P<mark>'+|\+(?=[ ),;.]|$)|\^'*(?=[ ),;:|]|$)|\*(?=[ ),;.]|$))?
    | (?P<number>\d+(?:\.\d+)?(?:e-?\d+)?)
    | (?P<operator><=|>=|\+-|->|>>|\+=|\.\.|[-+=<>/^~|()\[\]{}%,;*]|[^\s\w])""",
    re.VERBOSE,
)


class Token(NamedTuple):
    """A piece of text: its kind, its text, a name's mark (primes, + or ^), and the space before
    it.
    """

    kind: str
    text: str
    mark: str = ""
    space: str = ""


def tokens(text: str) -> list[Token]:
    """Split a text."""
    token_list = []
    space = ""
    for match in TOKEN.finditer(text):
        if match["space"]:
            space += match["space"]
            continue
        kind = next(k for k in ("code", "word", "name", "number", "operator") if match[k])
        token_list.append(Token(kind, match[kind], match["mark"] or "", space))
        space = ""
    return token_list


def is_symbol(token: Token, after: Token | None, gains: Collection[str]) -> bool:
    """Return whether a name is one of a formula, and not a word."""
    if token.kind != "name":
        return False
    text = token.text
    if text in ARTICLES and not token.mark:
        if (
            after is None
            or after.kind not in ("name", "word", "code")
            or not after.space
            or after.text in FUNCTIONS
        ):
            return True
        return text in gains and is_symbol(after, None, gains)
    has_symbol = text in gains or text in GREEK or text in FUNCTIONS or text in SYMBOLS
    head = text.partition("_")[0].rstrip("0123456789")
    return (
        has_symbol
        or len(head) == 1
        or head in GREEK
        or head in FUNCTIONS
        or (len(head) == 2 and token.mark.startswith("'"))
    )


def formula(text: str, gains: Collection[str] = ()) -> str:
    """Return a formula, which may contain words, as LaTeX."""
    return Parser(tokens(text), gains).all()


def clauses(text: str) -> list[str]:
    """Split a formula where a comma or a semicolon stands outside of brackets."""
    parts = []
    depth = 0
    start = 0
    for i, letter in enumerate(text):
        depth += (letter in OPEN) - (letter in CLOSE)
        if depth == 0 and letter in ",;" and text[i + 1 : i + 2] == " ":
            parts.append(text[start:i])
            start = i + 2
    return [*parts, text[start:]]


def sentence(text: str, gains: Collection[str] = ()) -> str:
    """Return a text with its formulas as $LaTeX$."""
    token_list = tokens(text)
    parts = []
    run = []
    for i, token in enumerate(token_list):
        after = token_list[i + 1] if i + 1 < len(token_list) else None
        ends = token.text in (",", ";") and (after is None or after.space != "")  # of a clause
        math = (
            token.kind in ("number", "operator")
            and token.text not in ".:!?\"'&"
            and not (ends and not _open(run))
        )
        before = token_list[i - 1] if i else None
        if not _is_unit(before, token, after) and (math or is_symbol(token, after, gains)):
            run.append(token)
            continue
        parts += [*_spell(run, gains), token.space + _plain(token)]
        run = []
    return "".join([*parts, *_spell(run, gains)]).strip()


def _is_unit(before: Token | None, token: Token, after: Token | None) -> bool:
    """Return whether a letter is a unit: after a number or the word "in", with a space; so is the m
    of N m.
    """
    if token.text not in ("m", "N", "s") or token.mark or before is None or not token.space:
        return False
    if (before.text, token.text) == ("N", "m"):
        return True
    alone = after is None or after.kind != "operator" or after.text in ".,;:)" or after.text == "/"
    return alone and (before.kind == "number" or (before.text == "in" and token.text != "s"))


def _plain(token: Token) -> str:
    return token.text + token.mark


def _open(run: list[Token]) -> int:
    """Return how many brackets are open at the end of a run."""
    return sum((t.text in OPEN) - (t.text in CLOSE) for t in run)


def _spell(run: list[Token], gains: Collection[str]) -> Iterator[str]:
    """Yield a run of what may be a formula: as $LaTeX$ where it is one, else as it is."""
    if not run:
        return
    unmatched = _unmatched(run)
    if unmatched is not None:
        yield from _spell(run[:unmatched], gains)
        yield run[unmatched].space + _plain(run[unmatched])
        yield from _spell(run[unmatched + 1 :], gains)
    elif run[-1].text in "-+=/<>^~|," or run[-1].text in ("<=", ">="):
        yield from _spell(run[:-1], gains)
        yield run[-1].space + _plain(run[-1])
    elif run[0].text in "=/^,)":
        yield run[0].space + _plain(run[0])
        yield from _spell(run[1:], gains)
    elif any(token.kind == "name" or token.text == "^" for token in run):
        inside = run[0]._replace(space=""), *run[1:]
        yield f"{run[0].space}${Parser(list(inside), gains, fractions=False).all()}$"
    else:
        yield from (token.space + _plain(token) for token in run)


def _unmatched(run: list[Token]) -> int | None:
    """Return the place of a bracket, or of a |, without its partner; None if all have one."""
    places: list[int] = []
    for i, token in enumerate(run):
        if token.text in OPEN:
            places.append(i)
        elif token.text in CLOSE:
            if not places or run[places[-1]].text != CLOSE[token.text]:
                return i
            places.pop()
    bars = [i for i, token in enumerate(run) if token.text == "|"]
    if places:
        return places[-1]
    return bars[-1] if len(bars) % 2 else None


class Parser:
    """Recursive descent over tokens: sums of products of factors."""

    def __init__(self, found: list[Token], gains: Collection[str], fractions: bool = True):
        self.tokens = found
        self.at = 0
        self.gains = gains
        self.fractions = fractions

    def peek(self, ahead: int = 0) -> Token | None:
        place = self.at + ahead
        if place < len(self.tokens):
            return self.tokens[place]
        return None

    def take(self) -> Token:
        self.at += 1
        return self.tokens[self.at - 1]

    def all(self) -> str:
        """Return the LaTeX of all that is left."""
        return self.until(()).strip()

    def until(self, ends: Collection[str]) -> str:
        """Return the LaTeX up to one of these brackets, which stays."""
        parts: list[str] = []
        while (token := self.peek()) and token.text not in ends:
            if self.starts_factor(token):
                parts.append(self.product())
            else:
                parts.append(self.other(self.take()))
        return " ".join(parts)

    def other(self, token: Token) -> str:
        """Return an operator or a word."""
        if token.kind == "code":
            return rf"\mathrm{{{_escaped(token.text.strip('`'))}}}"
        if token.kind in ("word", "name"):
            words = [token]
            while (
                (more := self.peek())
                and more.kind in ("word", "name")
                and not self.starts_factor(more)
            ):
                words.append(self.take())
            text = "".join(word.space + _plain(word) for word in words).strip()
            return r"\;" * (self.at > len(words)) + rf"\text{{{text}}}\;"
        if token.text in (",", ";"):
            return token.text + r"\;"
        return OPERATORS.get(token.text, _escaped(token.text))

    def starts_factor(self, token: Token) -> bool:
        if token.kind == "number" or token.text in ("(", "["):
            return True
        if token.text == "|":
            return True
        if self.peek() is token:
            return is_symbol(token, self.peek(1), self.gains)
        return token.kind == "name"

    def product(self) -> str:
        """Return factors side by side, and a fraction where a spaced slash follows them."""
        factors = [self.factor()]
        while token := self.peek():
            if (
                self.fractions
                and token.text == "/"
                and token.space
                and (after := self.peek(1))
                and after.space
            ):
                self.take()
                over = self.bare(factors)
                under = self.bare([self.factor()])
                factors = [rf"\frac{{{over}}}{{{under}}}"]
            elif token.text == "/":
                factors.append(self.take().text)
                if (after := self.peek()) and self.starts_factor(after):
                    factors.append(self.factor())
            elif self.starts_factor(token) and not (token.text == "|" and self.closing):
                factors.append(self.factor())
            else:
                break
        return "".join(_spaced(factors)).strip()

    closing = 0  # bars that are open

    def bare(self, factors: list[str]) -> str:
        """Return factors without the brackets around all of them."""
        text = "".join(_spaced(factors)).strip()
        if len(factors) == 1 and text.startswith("(") and _closes(text):
            return text[1:-1].strip()
        return text

    def factor(self) -> str:
        """Return an atom with its exponent."""
        token = self.take()
        if token.text in OPEN:
            base = self.group(token)
        elif token.text == "|":
            self.closing += 1
            base = rf"\left| {self.until('|')} \right|"
            self.closing -= 1
            if self.peek():
                self.take()
        elif token.kind == "number":
            mantissa, e, power = token.text.partition("e")
            if e:
                base = rf"{mantissa} \cdot 10^{{{power}}}"
            else:
                base = mantissa
        else:
            base = self.name(token)
        if (caret := self.peek()) and caret.text == "^":
            self.take()
            base = rf"{{{base}}}^{{{self.exponent()}}}"
        return base

    def group(self, token: Token) -> str:
        end = OPEN[token.text]
        bars, self.closing = self.closing, 0
        inside = self.until(end)
        self.closing = bars
        if self.peek():
            self.take()
        power = (caret := self.peek()) is not None and caret.text == "^"
        if token.text == "[" and power:
            return rf"\lfloor {inside} \rceil"
        return f"{token.text}{inside}{end}"

    def exponent(self) -> str:
        if (token := self.peek()) and token.text == "-":
            sign = self.take().text
        else:
            sign = ""
        if self.peek():
            return sign + self.bare([self.factor()])
        return sign

    def name(self, token: Token) -> str:
        """Return a symbol with its index and its mark, or a function with its argument."""
        text = token.text
        if text == "sqrt" and (bracket := self.peek()) and bracket.text == "(":
            return rf"\sqrt{{{self.bare([self.group(self.take())])}}}"
        if text in FUNCTIONS:
            name = marked(rf"\mathrm{{{text}}}", token.mark)
            if (caret := self.peek()) and caret.text == "^":
                self.take()
                name += rf"^{{{self.exponent()}}}"
            return name + (
                self.group(self.take())
                if (bracket := self.peek()) and bracket.text == "("
                else r"\,"
            )
        return marked(symbol(text, self.index()), token.mark) + self.arguments()

    def index(self) -> str:
        """Return the expression of an index, as of x_(i+1): the name then ends in _ ."""
        if (
            self.tokens[self.at - 1].text.endswith("_")
            and (token := self.peek())
            and token.text == "("
            and not token.space
        ):
            return self.bare([self.group(self.take())])
        return ""

    def arguments(self) -> str:
        """Return what stands in brackets right after a name."""
        token = self.peek()
        if token and token.text == "(" and not token.space:
            return self.group(self.take())
        return ""


def _spaced(factors: list[str]) -> Iterator[str]:
    """Yield factors with a thin space beside those of several letters, and between two numbers."""
    for before, factor in zip(["", *factors], factors, strict=False):
        wide = r"\mathrm" in (factor[:7], before[:7]) or (
            (before[-1:] or "x").isdigit() and factor[:1].isdigit()
        )
        apart = before and wide and "/" not in (before, factor)
        yield (r"\," if apart else " ") + factor


def _closes(text: str) -> bool:
    """Return whether the first bracket of a text is closed by its last character."""
    depth = 0
    for i, letter in enumerate(text):
        depth += (letter == "(") - (letter == ")")
        if depth == 0:
            return i == len(text) - 1
    return False


def _escaped(text: str) -> str:
    return re.sub(r"([#$%&_{}])", r"\\\1", text)


def symbol(text: str, index: str = "") -> str:
    """Return a name as LaTeX, with its digits and what follows an underscore as index."""
    last = text.endswith("_") and not index
    head, *rest = text.rstrip("_").split("_")
    if head in SYMBOLS and not rest:
        base = SYMBOLS[head]
        return f"{{{base}}}_-" if last else base
    letters = head.rstrip("0123456789")
    below = [
        head[len(letters) :],
        *(part if len(part) == 1 or part.isdigit() else rf"\mathrm{{{part}}}" for part in rest),
    ]
    below = [part for part in [*below, index, "-" * last] if part]
    base = (
        GREEK.get(letters)
        or SYMBOLS.get(letters)
        or (letters if len(letters) == 1 else rf"\mathrm{{{letters}}}")
    )
    base, indexed, first = base.partition("_")  # cf1 is c with index f, 1
    below = [first.strip("{}")] * bool(indexed) + below
    if below:
        return rf"{base}_{{{','.join(below)}}}"
    return base


def marked(base: str, mark: str) -> str:
    """Return a symbol with its primes, its hat, or the + of the next value."""
    if mark.startswith("'"):
        return f"{{{base}}}{mark}"
    if mark.startswith("^"):
        return rf"\hat{{{base}}}{mark[1:]}"
    return f"{{{base}}}^{{{mark}}}" if mark else base
