"""Writes the table of meanings: every operator over every pair of types with their edge values, and what must come of it.

    python3 tests/oracle/table.py > tests/data/meaning/table.txt

The first lines name lists of operand bits: `values TYPE LIST bits…` (hexadecimal). A line of the table is

    ARITHMETIC TARGET | OPERANDS … | TEMPLATE | CELLS

where ARITHMETIC is `codesys`, `iec` or `both`, with operands `TYPE.LIST` for `{a}`, `{b}`, `{c}`; several groups of operands stand beside each
other where their cells are equal. The cells follow the operands' lists, the last one fastest: bits of the target in hexadecimal, `!` for a division
by zero, `?` where the table does not say. Cells of a BOOL stand without spaces.

`implicit SOURCE TARGET.` says what the compiler says of an assignment: nothing (`.`), a warning (`w`), an error (`e`).
"""

import itertools
import sys
from fractions import Fraction

import expressions
import rational
from meaning import (CLOCKS, DATES, DAY, DURATIONS, ELEMENTARY, INTEGERS, REALS, TIMES, Fault, Language, Unknown, Value, common, implicit,
                     integer_range, literal, load, shape, to_integer, width)

COMPARISONS = ["=", "<>", "<", "<=", ">", ">="]


def integer_edges(name, which):
    low, high = integer_range(name)
    bits = width(name)
    small = [low, -1, 0, 1, 7, high] if low < 0 else [0, 1, 7, 1 << bits - 1, high - 1, high]
    if which == "few":
        return [low, -1, 1, high] if low < 0 else [0, 1, high]
    if which == "small":
        return small
    powers = [(1 << k) + d for k in (7, 8, 15, 16, 24, 31, 32, 53, 63) for d in (-1, 0, 1)]
    full = [low, low + 1, -1, 0, 1, 2, 3, 99, high - 1, high, *powers, *(-p for p in powers)]
    return sorted({v for v in full if low <= v <= high})


def real_edges(name, which):
    form = REALS[name]
    largest = rational.decode(rational.encode(("inf", 0), form) - 1, form)
    tiny = rational.decode(1, form)
    near = [Fraction(n, 2) for n in (1, 3, 5)]
    small = [rational.NAN, ("inf", 1), ("inf", 0), rational.number(0), rational.number(0, 1), rational.number(1), rational.number(Fraction(-5, 2)),
             tiny, largest, rational.number((1 << 24) + 1)]
    if which == "few":
        return [rational.NAN, rational.number(0, 1), rational.number(1), rational.number(Fraction(-5, 2)), rational.number(70000)]
    if which == "small":
        return small
    wide = [(1 << k) + d for k in (7, 8, 15, 16, 24, 31, 32, 53, 63, 64) for d in (Fraction(-1), Fraction(-1, 2), 0, Fraction(1, 2), 1)]
    halves = [*near, Fraction(1, 4), Fraction(1, 10), Fraction(49999999, 100000000), 123456789, *wide]
    smallest = rational.decode(1 << form[1], form)
    return small + [smallest, rational.number(Fraction(1 << 100))] + [rational.number(s * h) for h in halves for s in (1, -1)]


def time_edges(name, which):
    bits, sign, unit = TIMES[name]
    high = (1 << bits - (1 if sign else 0)) - 1
    second, day = 10**9 // unit, DAY // unit
    small = [0, 1, 3 * second // 2, day + 7 * second, high]
    if sign:
        small += [-1, -3 * second // 2, -(1 << 63)]
    if which == "few":
        return [1, 3 * second // 2, -3 * second // 2 if sign else high]
    if which != "full":
        return small
    more = [second, second - 1, 1000, 999, 499, 500, day, day - 1, day + 1, 365 * day + 12345 * second, 1 << 31, high - 1]
    return sorted({v for v in small + more + ([-v for v in more] if sign else []) if v <= high})


def edges(name, which):
    """The bits of a list."""
    if which == "shifts":
        counts = [0, 1, 7, 8, 9, 15, 16, 17, 31, 32, 33, 63, 64, 65, 127, -1, -8]
        return [c & ((1 << width(name)) - 1) for c in counts if integer_range(name)[0] <= c <= integer_range(name)[1]]
    if which == "powers":
        numbers = [0, 1, 2, 3, 10, 13] + ([-1, -2, -3] if name in REALS or shape(name)[1] else [])
        if name in REALS:
            return [rational.encode(rational.number(n), REALS[name]) for n in (*numbers, Fraction(1, 2))]
        return [n & ((1 << width(name)) - 1) for n in numbers]
    if name == "BOOL":
        return [0, 1]
    if which == "one":
        return [1]
    if name in REALS:
        found = [rational.encode(v, REALS[name]) for v in real_edges(name, which)]
    else:
        of = integer_edges if name in INTEGERS else time_edges
        found = [v & ((1 << width(name)) - 1) for v in of(name, which)]
    return list(dict.fromkeys(found))


class Table:
    def __init__(self):
        self.lists = {}
        self.lines = {}
        self.verdicts = []

    def operand(self, name, which):
        key = f"{name}.{which}"
        self.lists.setdefault(key, edges(name, which))
        return key

    def cell(self, language, meaning, values, target):
        try:
            return f"{language.assign(meaning(language, *values), target):x}"
        except Fault:
            return "!"
        except Unknown:
            return "?"

    def add(self, arithmetic, template, meaning, operands, targets):
        """A line per target and arithmetic (`codesys`, `iec`)."""
        keys = [self.operand(*o) for o in operands]
        rows = [[load(o[0], b) for o, b in zip(operands, row)] for row in itertools.product(*(self.lists[k] for k in keys))]
        for target in targets:
            found = {name: [self.cell(Language(name == "iec"), meaning, row, target) for row in rows] for name in arithmetic}
            if len(found) == 2 and found["codesys"] == found["iec"]:
                found = {"both": found["iec"]}
            for name, cells in found.items():
                if set(cells) != {"?"}:
                    joined = "".join(cells) if target == "BOOL" else " ".join(cells)
                    self.lines.setdefault((name, target, template, joined), []).append(",".join(keys))

    def implicit(self, source, target):
        self.verdicts.append((source, target, implicit(source, target)))

    def write(self, out):
        for key, bits in self.lists.items():
            name, which = key.split(".")
            out.write(f"values {name} {which} {' '.join(f'{b:x}' for b in bits)}\n")
        for (arithmetic, target, template, cells), groups in self.lines.items():
            out.write(f"{arithmetic} {target} | {' '.join(groups)} | {template} | {cells}\n")
        for source, group in itertools.groupby(self.verdicts, lambda v: v[0]):
            out.write(f"implicit {source} {' '.join(target + verdict for _, target, verdict in group)}\n")


BOTH = ("codesys", "iec")
CODESYS = ("codesys",)
NARROW = ["SINT", "USINT", "INT", "WORD", "DINT", "UDINT"]


def integers(table):
    for i, (a, b) in enumerate(itertools.product(INTEGERS, repeat=2)):
        pair = [(a, "small"), (b, "small")]
        for sign in ("+", "-", "*", "/", "MOD"):
            def meaning(m, x, y, sign=sign):
                return m.arithmetic(sign, x, y)
            table.add(BOTH, f"{{a}} {sign} {{b}}", meaning, pair, ["LINT"])
            table.add(CODESYS, f"{{a}} {sign} {{b}}", meaning, pair, [NARROW[i % 6]])
        table.add(CODESYS, "{a} + {b}", lambda m, x, y: m.arithmetic("+", x, y), pair, ["LREAL"])
        own = common(a, b)
        table.add(CODESYS, f"TO_{own}({{a}} + {{b}})", lambda m, x, y: m.convert(m.arithmetic("+", x, y), own), pair, ["LINT"])
        table.add(BOTH, "({a} + {b}) / 3", lambda m, x, y: m.arithmetic("/", m.arithmetic("+", x, y), load("SINT", 3)), pair, ["LINT"])
        table.add(BOTH, "{a} - {b} < {a}", lambda m, x, y: m.compare("<", m.arithmetic("-", x, y), x), pair, ["BOOL"])
        for sign in COMPARISONS:
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.compare(sign, x, y), pair, ["BOOL"])
        for sign in ("AND", "OR", "XOR"):
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.bits(sign, x, y), pair, ["LINT"])
        for name in ("MIN", "MAX"):
            table.add(CODESYS, f"{name}({{a}}, {{b}})", lambda m, x, y: m.extreme(name, x, y), pair, ["LINT"])
        table.add(CODESYS, "SEL({a} < {b}, {a}, {b})", lambda m, x, y: m.select(m.compare("<", x, y), x, y), pair, ["LINT"])


def single_integers(table):
    for a in INTEGERS:
        one = [(a, "full")]
        for target in ("LINT", a, "SINT", "UDINT"):
            table.add(BOTH, "-{a}", lambda m, x: m.negative(x), one, [target])
            table.add(BOTH, "ABS({a})", lambda m, x: m.absolute(x), one, [target])
            table.add(CODESYS, "NOT {a}", lambda m, x: m.invert(x), one, [target])
        table.add(BOTH, "-{a} / 2", lambda m, x: m.arithmetic("/", m.negative(x), load("SINT", 2)), one, ["LINT"])
        table.add(CODESYS, "-{a}", lambda m, x: m.negative(x), one, ["LREAL"])
        table.add(CODESYS, "ABS({a})", lambda m, x: m.absolute(x), one, ["LREAL"])
        for name, count in itertools.product(("SHL", "SHR", "ROL", "ROR"), ("INT", "USINT", "LINT")):
            table.add(CODESYS, f"{name}({{a}}, {{b}})", lambda m, x, n: m.shift(name, x, n), [(a, "small"), (count, "shifts")], ["LINT"])
        few = [(a, "few")] * 3
        table.add(CODESYS, "LIMIT({a}, {b}, {c})", lambda m, x, y, z: m.limit(x, y, z), few, [a])
        table.add(CODESYS, "MUX({a}, {b}, {c})", lambda m, k, x, y: m.multiplex(k, x, y), few, [a])
        table.add(BOTH, "{a} ** {b}", lambda m, x, y: m.integer_power(x, y), [(a, "powers"), ("DINT", "powers")], ["LINT"])
        table.add(CODESYS, "EXPT({a}, {b})", lambda m, x, y: m.power(x, y), [(a, "powers"), ("DINT", "powers")], ["LREAL", "LINT"])


def reals(table):
    pairs = [*itertools.product(REALS, REALS), *itertools.product(REALS, INTEGERS), *itertools.product(INTEGERS, REALS)]
    for a, b in pairs:
        pair = [(a, "small"), (b, "small")]
        targets = ["LREAL", "REAL"] if a in REALS and b in REALS else ["LREAL"]
        for sign in ("+", "-", "*", "/"):
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.arithmetic(sign, x, y), pair, targets)
        for sign in COMPARISONS:
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.compare(sign, x, y), pair, ["BOOL"])
        for name in ("MIN", "MAX"):
            table.add(CODESYS, f"{name}({{a}}, {{b}})", lambda m, x, y: m.extreme(name, x, y), pair, ["LREAL"])
    for a, b in itertools.product(REALS, REALS):
        table.add(CODESYS, "EXPT({a}, {b})", lambda m, x, y: m.power(x, y), [(a, "powers"), (b, "powers")], ["LREAL"])
    for a in REALS:
        one = [(a, "full")]
        table.add(CODESYS, "-{a}", lambda m, x: m.negative(x), one, [a])
        table.add(CODESYS, "ABS({a})", lambda m, x: m.absolute(x), one, [a])
        table.add(CODESYS, "SQRT({a})", lambda m, x: type(x)(x.type, rational.square_root(x.data, REALS[x.type])), one, [a])
        truncation = lambda m, x: load("LINT", to_integer(rational.whole(x.data, "trunc")))  # noqa: E731
        table.add(CODESYS, "TRUNC({a})", lambda m, x: m.convert(truncation(m, x), "DINT"), one, ["LINT"])
        table.add(CODESYS, "TRUNC_INT({a})", lambda m, x: m.convert(truncation(m, x), "INT"), one, ["LINT"])
        for name in ("FLOOR", "CEIL"):
            table.add(CODESYS, f"{name}({{a}})", lambda m, x: type(x)(x.type, rational.whole(x.data, name.lower())), one, [a])
        few = [(a, "few")] * 3
        table.add(CODESYS, "LIMIT({a}, {b}, {c})", lambda m, x, y, z: m.limit(x, y, z), few, [a])
        table.add(CODESYS, "SEL({a} < {b}, {b}, {c})", lambda m, x, y, z: m.select(m.compare("<", x, y), y, z), few, [a])


def booleans(table):
    two = [("BOOL", "full")] * 2
    for sign in ("AND", "OR", "XOR"):
        table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.bits(sign, x, y), two, ["BOOL"])
    for sign in COMPARISONS:
        table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.compare(sign, x, y), two, ["BOOL"])
    table.add(CODESYS, "NOT {a}", lambda m, x: m.invert(x), two[:1], ["BOOL"])
    table.add(CODESYS, "{a} AND_THEN {b}", lambda m, x, y: m.bits("AND", x, y), two, ["BOOL"])
    table.add(CODESYS, "{a} OR_ELSE {b}", lambda m, x, y: m.bits("OR", x, y), two, ["BOOL"])
    table.add(CODESYS, "SEL({a}, {b}, {c})", lambda m, g, x, y: m.select(g, x, y), two + two[:1], ["BOOL"])


def times(table):
    for a, b in itertools.product(DURATIONS, repeat=2):
        pair = [(a, "small"), (b, "small")]
        for sign in ("+", "-", "MOD", "/"):
            table.add(BOTH, f"{{a}} {sign} {{b}}", lambda m, x, y: m.span_arithmetic(sign, x, y), pair, ["LINT" if sign == "/" else "LTIME"])
        for name in ("MIN", "MAX"):
            table.add(CODESYS, f"{name}({{a}}, {{b}})", lambda m, x, y: m.extreme(name, x, y), pair, ["LTIME"])
        for sign in COMPARISONS:
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.compare(sign, x, y), pair, ["BOOL"])
    for a, b in itertools.product(DURATIONS, [*INTEGERS, *REALS]):
        for sign in ("*", "/"):
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.scaled(sign, x, y), [(a, "small"), (b, "small")], [a])
        table.add(CODESYS, "{b} * {a}", lambda m, x, y: m.scaled("*", y, x), [(a, "small"), (b, "small")], [a])
    for a, b in itertools.product(DURATIONS, repeat=2):
        pair = [(a, "small"), (b, "small")]
        table.add(BOTH, "{a} - {b} < {a}", lambda m, x, y: m.compare("<", m.span_arithmetic("-", x, y), x), pair, ["BOOL"])
    for a in DURATIONS:
        table.add(BOTH, "-{a}", lambda m, x: m.negative(x), [(a, "full")], [a])
        table.add(CODESYS, "LIMIT({a}, {b}, {c})", lambda m, x, y, z: m.limit(x, y, z), [(a, "small")] * 3, [a])
    for a in (*DATES, *CLOCKS):
        pair = [(a, "small")] * 2
        span = "LTIME" if shape(a)[0] == 64 else "TIME"
        table.add(CODESYS, "{a} - {b}", lambda m, x, y: m.difference(x, y), pair, [span])
        for sign in COMPARISONS:
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.compare(sign, x, y), pair, ["BOOL"])
        for name in ("MIN", "MAX"):
            table.add(CODESYS, f"{name}({{a}}, {{b}})", lambda m, x, y: m.extreme(name, x, y), pair, [a])
        for sign in ("+", "-"):
            table.add(CODESYS, f"{{a}} {sign} {{b}}", lambda m, x, y: m.moved(sign, x, y), [(a, "small"), (span, "small")], [a])


def literals(table):
    """A literal beside a variable."""
    for a in INTEGERS:
        one = [(a, "full")]
        for sign, number in itertools.product(("+", "-", "*", "/", "MOD"), (1, 10, -3, 200, 70000)):
            table.add(BOTH, f"{{a}} {sign} {number}", lambda m, x: m.arithmetic(sign, x, literal(number, x.type)), one, ["LINT"])
            if sign in "-*":
                table.add(BOTH, f"{number} {sign} {{a}}", lambda m, x: m.arithmetic(sign, literal(number, x.type), x), one, ["LINT"])
        for sign, number in itertools.product(("<", "=", ">="), (0, -1, 200, 70000)):
            table.add(CODESYS, f"{{a}} {sign} {number}", lambda m, x: m.compare(sign, x, literal(number, x.type)), one, ["BOOL"])
        half = Value("LREAL", rational.number(Fraction(1, 2)))
        table.add(CODESYS, "{a} * 0.5", lambda m, x: m.arithmetic("*", x, half), one, ["LREAL"])
        table.add(CODESYS, "{a} + 1 > {a}", lambda m, x: m.compare(">", m.arithmetic("+", x, literal(1, x.type)), x), one, ["BOOL"])
    for a in REALS:
        tenth = rational.rounded(rational.number(Fraction(1, 10)), REALS[a])
        for sign in ("+", "*", "/"):
            table.add(CODESYS, f"{{a}} {sign} 0.1", lambda m, x: m.arithmetic(sign, x, Value(x.type, tenth)), [(a, "full")], ["LREAL"])
            table.add(CODESYS, f"{{a}} {sign} 3", lambda m, x: m.arithmetic(sign, x, literal(3, "INT")), [(a, "full")], ["LREAL"])


def conversions(table):
    for a, b in itertools.product(ELEMENTARY, repeat=2):
        if a != b:
            table.add(CODESYS, f"{a}_TO_{b}({{a}})", lambda m, x: m.convert(x, b), [(a, "full")], [b])
            table.add(CODESYS, f"TO_{b}({{a}})", lambda m, x: m.convert(x, b), [(a, "few")], [b])
            table.implicit(a, b)
    numbers = [*INTEGERS, *REALS]
    for a, b in [*itertools.product(numbers, repeat=2), *itertools.product(DURATIONS, repeat=2)]:
        table.add(CODESYS, "{a}", lambda m, x: x, [(a, "full")], [b])


def main():
    table = Table()
    for part in (integers, single_integers, reals, booleans, times, literals, expressions.fill, conversions):
        part(table)
    sys.stdout.write("# Written by tests/oracle/table.py, which says what it means.\n")
    table.write(sys.stdout)


main()
