"""Expressions of several operators, chosen at random but always the same: what one operator leaves is what the next one takes."""

import random
from fractions import Fraction

import rational
from meaning import DURATIONS, INTEGERS, REALS, Value, literal

COUNT = 560
BOTH = ("codesys", "iec")


class Node:
    """A text with `{a}`, `{b}`, `{c}`, its type, and what it means given the operands."""

    def __init__(self, text, kind, meaning):
        self.text, self.kind, self.meaning = text, kind, meaning


class Chooser:
    def __init__(self, seed):
        self.random = random.Random(seed)
        self.types = [self.random.choice([*INTEGERS, *INTEGERS, *REALS, *DURATIONS]) for _ in range(3)]

    def leaf(self):
        i = self.random.randrange(3)
        name = self.types[i]
        kind = "integer" if name in INTEGERS else "real" if name in REALS else "span"
        return Node("{" + "abc"[i] + "}", kind, lambda m, v: v[i])

    def expression(self, depth):
        if depth == 0:
            return self.leaf()
        a, b = self.expression(depth - 1), self.expression(self.random.randrange(depth))
        makers = {
            ("integer", "integer"): [self.arithmetic, self.arithmetic, self.bits, self.shift, self.extreme, self.choice],
            ("integer", "real"): [self.real, self.extreme], ("real", "integer"): [self.real, self.extreme],
            ("real", "real"): [self.real, self.extreme, self.choice],
            ("span", "span"): [self.spans, self.spans, self.extreme], ("span", "integer"): [self.scaled],
            ("span", "real"): [self.scaled],
        }.get((a.kind, b.kind), [])
        return self.random.choice([*makers, *makers, self.single])(a, b)

    def arithmetic(self, a, b):
        sign = self.random.choice(["+", "-", "*", "/", "MOD"])
        return Node(f"({a.text} {sign} {b.text})", "integer", lambda m, v: m.arithmetic(sign, a.meaning(m, v), b.meaning(m, v)))

    def bits(self, a, b):
        sign = self.random.choice(["AND", "OR", "XOR"])
        return Node(f"({a.text} {sign} {b.text})", "integer", lambda m, v: m.bits(sign, a.meaning(m, v), b.meaning(m, v)))

    def shift(self, a, b):
        name, count = self.random.choice(["SHL", "SHR", "ROL", "ROR"]), self.random.choice([1, 4, 9, 33])
        return Node(f"{name}({a.text}, {count})", "integer", lambda m, v: m.shift(name, a.meaning(m, v), Value("INT", count)))

    def extreme(self, a, b):
        name = self.random.choice(["MIN", "MAX"])
        kind = "real" if "real" in (a.kind, b.kind) else a.kind
        return Node(f"{name}({a.text}, {b.text})", kind, lambda m, v: m.extreme(name, a.meaning(m, v), b.meaning(m, v)))

    def choice(self, a, b):
        sign = self.random.choice(["<", ">=", "=", "<>"])

        def meaning(m, v):
            x, y = a.meaning(m, v), b.meaning(m, v)
            return m.select(m.compare(sign, x, y), x, y)
        return Node(f"SEL({a.text} {sign} {b.text}, {a.text}, {b.text})", a.kind, meaning)

    def real(self, a, b):
        sign = self.random.choice(["+", "-", "*", "/"])
        return Node(f"({a.text} {sign} {b.text})", "real", lambda m, v: m.arithmetic(sign, a.meaning(m, v), b.meaning(m, v)))

    def spans(self, a, b):
        sign = self.random.choice(["+", "-"])
        return Node(f"({a.text} {sign} {b.text})", "span", lambda m, v: m.span_arithmetic(sign, a.meaning(m, v), b.meaning(m, v)))

    def scaled(self, a, b):
        sign = self.random.choice(["*", "/"])
        return Node(f"({a.text} {sign} {b.text})", "span", lambda m, v: m.scaled(sign, a.meaning(m, v), b.meaning(m, v)))

    def single(self, a, _):
        which = self.random.choice(["-", "convert", "literal", *(["NOT", "ABS", "pass"] if a.kind == "integer" else [])])
        if which == "-":
            return Node(f"(-{a.text})", a.kind, lambda m, v: m.negative(a.meaning(m, v)))
        if which == "NOT":
            return Node(f"(NOT {a.text})", a.kind, lambda m, v: m.invert(a.meaning(m, v)))
        if which == "ABS":
            return Node(f"ABS({a.text})", a.kind, lambda m, v: m.absolute(a.meaning(m, v)))
        if which == "pass":
            to = self.random.choice([*INTEGERS])
            return Node(f"pass_{to}({a.text})", "integer", lambda m, v: m.passed(a.meaning(m, v), to))
        if which == "convert":
            to = self.random.choice([*INTEGERS, "LREAL", "TIME", "LTIME"])
            kind = "integer" if to in INTEGERS else "real" if to in REALS else "span"
            return Node(f"TO_{to}({a.text})", kind, lambda m, v: m.convert(a.meaning(m, v), to))
        return self.with_literal(a)

    def with_literal(self, a):
        number = self.random.choice([1, 2, 10, 100, 300, 70000])
        if a.kind == "span":
            return Node(f"({a.text} * {number})", "span", lambda m, v: m.scaled("*", a.meaning(m, v), literal(number, "INT")))
        if a.kind == "real":
            half = Value("LREAL", rational.number(Fraction(1, 2)))

            def meaning(m, v):
                x = a.meaning(m, v)
                return m.arithmetic("+", x, Value(x.type, half.data))
            return Node(f"({a.text} + 0.5)", "real", meaning)
        sign = self.random.choice(["+", "-", "*", "/", "MOD"])

        def meaning(m, v):
            x = a.meaning(m, v)
            return m.arithmetic(sign, x, literal(number, x.type))
        return Node(f"({a.text} {sign} {number})", "integer", meaning)


def fill(table):
    for seed in range(COUNT):
        chooser = Chooser(seed)
        node = chooser.expression(chooser.random.choice([2, 3, 3]))
        target = {"integer": "LINT", "real": "LREAL", "span": "LTIME"}[node.kind]
        if node.kind == "integer" and chooser.random.random() < 0.3:
            target = chooser.random.choice([*INTEGERS])
        letters = [letter in node.text for letter in ("{a}", "{b}", "{c}")]
        # Operands that do not occur have one value.
        operands = [(t, "few" if used else "one") for t, used in zip(chooser.types, letters)]
        table.add(BOTH, node.text, lambda m, *v: node.meaning(m, v), operands, [target])
