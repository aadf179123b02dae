"""ALExpressionWatcher: conditions over ALMemory's keys, and objects that signal them.

The language is that of the maker's documentation of trigger conditions, without `rand`.
"""

import operator
import re
from collections import deque
from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import Service

_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*)|(?P<key>'[^']*')|(?P<text>\"[^\"]*\")|(?P<name>[A-Za-z]+)"
    r"|(?P<sign>&&|\|\||==|!=|<=|>=|[()\[\],!<>+\-*/%|&^~@#]))"
)
_LONGEST = 3600.0
"""Longest time that an expression may look back [s]."""
_DEEPEST = 30
_LARGEST_TEXT = 4000

Evaluate = Callable[[float], Any]
"""The value of a part of an expression at a time [s]."""


def _product(a: Any, b: Any) -> Any:
    """Multiplies numbers; a text or list times a number could be of any size."""
    if isinstance(a, str | list) or isinstance(b, str | list):
        raise TypeError("only numbers are multiplied")
    return a * b


_BINARY: tuple[dict[str, Callable[[Any, Any], Any]], ...] = (
    {"||": lambda a, b: bool(a) or bool(b)},
    {"&&": lambda a, b: bool(a) and bool(b)},
    {"==": operator.eq, "!=": operator.ne},
    {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge},
    {
        "|": lambda a, b: int(a) | int(b),
        "&": lambda a, b: int(a) & int(b),
        "^": lambda a, b: int(a) ^ int(b),
    },
    {"+": operator.add, "-": operator.sub},
    {"*": _product, "/": operator.truediv, "%": operator.mod},
    {
        "subsets": lambda a, b: set(_items(a)) <= set(_items(b)),
        "intersects": lambda a, b: bool(set(_items(a)) & set(_items(b))),
    },
)
"""Operators by precedence, the lowest first."""

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "int": int,
    "float": float,
    "string": str,
    "bool": bool,
    "size": len,
    "strlen": len,
    "substr": lambda text, start, count: text[int(start) : int(start) + int(count)],
    "concat": lambda first, second: str(first) + str(second),
    "type": lambda value: {
        bool: "Bool", int: "Int", float: "Float", str: "String", list: "Array"
    }.get(type(value), "Invalid"),
}  # fmt: skip


class Expression:
    """A condition, with the history of its keys as far back as it refers to."""

    def __init__(self, text: str, read: Callable[[str], Any]) -> None:
        """Parses a condition.

        Args:
            text: The condition.
            read: Returns the current value of a key, or None.

        Raises:
            ValueError: The text is not a condition.
        """
        if len(text) > _LARGEST_TEXT:
            raise ValueError("the expression is too long")
        self._read = read
        self._history: dict[str, deque[tuple[float, Any]]] = {}
        self._reach = 0.0
        self._tokens = _tokens(text)
        self._position = 0
        self._depth = 0
        self._evaluate = self._binary(0)
        if self._position != len(self._tokens):
            raise ValueError(f"the expression is not understood at {self._peek()!r}")

    def step(self, now: float) -> None:
        """Records the values of the keys."""
        for key, past in self._history.items():
            value = self._read(key)
            if not past or past[-1][1] != value:
                past.append((now, value))
            while len(past) > 1 and past[1][0] < now - self._reach:
                past.popleft()

    def value(self, now: float) -> Any:
        """Returns the current value, None if it cannot be computed."""
        try:
            return self._evaluate(now)
        except (TypeError, ValueError, ArithmeticError):
            return None

    def _peek(self) -> str:
        return self._tokens[self._position] if self._position < len(self._tokens) else ""

    def _next(self) -> str:
        token = self._peek()
        if not token:
            raise ValueError("the expression ends too soon")
        self._position += 1
        return token

    def _expect(self, token: str) -> None:
        found = self._next()
        if found != token:
            raise ValueError(f"the expression has {found!r} where {token!r} is due")

    def _binary(self, level: int) -> Evaluate:
        if level == len(_BINARY):
            return self._timed()
        left = self._binary(level + 1)
        while self._peek() in _BINARY[level]:
            apply = _BINARY[level][self._next()]
            left = _applied(apply, left, self._binary(level + 1))
        return left

    def _timed(self) -> Evaluate:
        found = self._unary()
        while self._peek() in ("~", "@", "#"):
            sign, seconds = self._next(), self._next()
            if not re.fullmatch(r"\d+\.?\d*", seconds) or float(seconds) > _LONGEST:
                raise ValueError(f"after {sign} comes a number of seconds up to {_LONGEST:g}")
            self._reach += float(seconds)
            found = {"~": self._held, "@": _ago, "#": self._recently}[sign](found, float(seconds))
        return found

    def _unary(self) -> Evaluate:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ValueError("the expression is nested too deeply")
        try:
            if self._peek() == "!":
                self._next()
                inner = self._unary()
                return lambda now: not inner(now)
            if self._peek() == "-":
                self._next()
                negated = self._unary()
                return lambda now: -negated(now)
            return self._primary()
        finally:
            self._depth -= 1

    def _primary(self) -> Evaluate:
        token = self._next()
        if token == "(":
            inner = self._binary(0)
            self._expect(")")
            return inner
        if token == "[":
            items = self._arguments("]")
            return lambda now: [item(now) for item in items]
        if token[0] == "'":
            key = token[1:-1]
            self._history.setdefault(key, deque())
            return lambda now: self._at(key, now)
        if token[0] == '"':
            return lambda _: token[1:-1]
        if token[0].isdigit():
            number = float(token) if "." in token else int(token)
            return lambda _: number
        if token in ("true", "false", "True", "False"):
            return lambda _: token.lower() == "true"
        self._expect("(")
        arguments = self._arguments(")")
        if token in _FUNCTIONS:
            function = _FUNCTIONS[token]
            return lambda now: function(*(argument(now) for argument in arguments))
        if token in ("bang", "stable") and len(arguments) == 1:
            # Changes are detected within the robot's cycle of 20 ms.
            inner = arguments[0]
            steady = token == "stable"
            return lambda now: (inner(now) == inner(now - 0.02)) == steady
        raise ValueError(f"{token} is not a function of an expression")

    def _arguments(self, end: str) -> list[Evaluate]:
        found: list[Evaluate] = []
        while self._peek() != end:
            if found:
                self._expect(",")
            found.append(self._binary(0))
        self._next()
        return found

    def _at(self, key: str, now: float) -> Any:
        past = self._history[key]
        for time, value in reversed(past):
            if time <= now + 1e-6:
                return value
        return None

    def _moments(self, start: float, end: float) -> list[float]:
        """Returns the times of changes of keys between two times, and these two."""
        times = {t for past in self._history.values() for t, _ in past if start < t < end}
        return [start, *sorted(times), end]

    def _held(self, inner: Evaluate, seconds: float) -> Evaluate:
        return lambda now: all(inner(t) for t in self._moments(now - seconds, now))

    def _recently(self, inner: Evaluate, seconds: float) -> Evaluate:
        return lambda now: any(inner(t) for t in self._moments(now - seconds, now))


class ExpressionWatcher(Module):
    """ALExpressionWatcher."""

    CHANGE, EDGE, EDGE_TRUE = 0, 1, 2
    """Report modes."""

    def __init__(self, read: Callable[[str], Any], clock: Callable[[], float]) -> None:
        """Makes the service without expressions.

        Args:
            read: Returns the value of a key of ALMemory, or None.
            clock: Returns the robot's time [s].
        """
        super().__init__("ALExpressionWatcher")
        self._read = read
        self._clock = clock
        self._watched: list[Callable[[float], None]] = []

    def step(self, now: float) -> None:
        """Evaluates all watched expressions."""
        for look in list(self._watched):
            look(now)

    def add(self, text: str, mode: int) -> Service:
        """Returns an object that signals changes of an expression until it is released.

        Args:
            text: The expression.
            mode: 0 signals a change of the value, 1 of its truth, 2 that it becomes true.
        """
        if mode not in (self.CHANGE, self.EDGE, self.EDGE_TRUE):
            raise ValueError(f"there is no report mode {mode}; it must be 0, 1 or 2")
        expression = Expression(text, self._read)
        expression.step(self._clock())
        last = expression.value(self._clock())
        service = Service(description=f"expression {text}")
        service.add_method("getValue", "()", "m", lambda: expression.value(self._clock()))
        service.add_method("getExpression", "()", "s", lambda: text)
        service.add_method("getReportMode", "()", "i", lambda: mode)
        service.add_signal("signal", "(m)")

        def look(now: float) -> None:
            nonlocal last
            expression.step(now)
            value, before = expression.value(now), last
            last = value
            if mode == self.CHANGE:
                tells = value != before
            else:
                tells = bool(value) != bool(before) and (mode == self.EDGE or bool(value))
            if tells:
                service.emit("signal", value)

        self._watched.append(look)
        service.on_terminated = lambda: self._watched.remove(look)
        return service


def _items(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _applied(apply: Callable[[Any, Any], Any], left: Evaluate, right: Evaluate) -> Evaluate:
    return lambda now: apply(left(now), right(now))


def _ago(inner: Evaluate, seconds: float) -> Evaluate:
    return lambda now: inner(now - seconds)


def _tokens(text: str) -> list[str]:
    tokens, place = [], 0
    text = text.strip()
    while place < len(text):
        found = _TOKEN.match(text, place)
        if found is None:
            raise ValueError(f"the expression is not understood at {text[place : place + 20]!r}")
        tokens.append(found.group().strip())
        place = found.end()
    return tokens
