"""What expressions of elementary types mean: the rules of the language, written a second time.

An integer is a register of 64 bits (0 <= register < 2**64) with the type it stands for; what is computed may exceed the type until it is stored,
passed or converted. With `iec` it is cut at each operator. A REAL is a value of `rational`.
"""

from dataclasses import dataclass

import rational

INTEGERS = {
    "BYTE": (8, False), "WORD": (16, False), "DWORD": (32, False), "LWORD": (64, False),
    "SINT": (8, True), "INT": (16, True), "DINT": (32, True), "LINT": (64, True),
    "USINT": (8, False), "UINT": (16, False), "UDINT": (32, False), "ULINT": (64, False),
}
REALS = {"REAL": rational.REAL, "LREAL": rational.LREAL}
# Width, sign, nanoseconds of a unit.
TIMES = {
    "TIME": (32, False, 10**6), "LTIME": (64, True, 1),
    "DATE": (32, False, 10**9), "LDATE": (64, False, 1),
    "TOD": (32, False, 10**6), "LTOD": (64, False, 1),
    "DT": (32, False, 10**9), "LDT": (64, False, 1),
}
DURATIONS = ("TIME", "LTIME")
DAYS = ("DATE", "LDATE")
CLOCKS = ("TOD", "LTOD")
DATES = ("DATE", "LDATE", "DT", "LDT")
DAY = 86_400 * 10**9
ELEMENTARY = ["BOOL", *INTEGERS, *REALS, *TIMES]
MASK = (1 << 64) - 1


class Fault(Exception):
    """The scan ends here."""


class Unknown(Exception):
    """The result is not one that arithmetic alone can tell."""


@dataclass
class Value:
    type: str
    data: object  # register, or a value of `rational`


def shape(name):
    """Width and sign of an integer-like type."""
    if name == "BOOL":
        return 1, False
    return INTEGERS[name] if name in INTEGERS else TIMES[name][:2]


def width(name):
    return {"BOOL": 8, "REAL": 32, "LREAL": 64}.get(name) or shape(name)[0]


def integer_range(name):
    bits, sign = shape(name)
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if sign else (0, (1 << bits) - 1)


def as_signed(register):
    return register - (1 << 64) if register >> 63 else register


def number_of(name, register):
    """The number that a register within the range of its type stands for."""
    return as_signed(register) if shape(name)[1] else register


def cut(name, register):
    if name == "BOOL":
        return int(register != 0)
    bits, sign = shape(name)
    low = register & ((1 << bits) - 1)
    return (low - (1 << bits) if sign and low >> bits - 1 else low) & MASK


def load(name, bits):
    if name in REALS:
        return Value(name, rational.decode(bits, REALS[name]))
    return Value(name, cut(name, bits & MASK))


def common(a, b):
    """The smallest type that holds both; ULINT if there is none."""
    if a == b:
        return a
    (al, ah), (bl, bh) = integer_range(a), integer_range(b)
    for name, (low, high) in ((a, (al, ah)), (b, (bl, bh))):
        if low <= min(al, bl) and high >= max(ah, bh):
            return name
    for name in ("INT", "DINT", "LINT"):
        low, high = integer_range(name)
        if low <= min(al, bl) and high >= max(ah, bh):
            return name
    return "ULINT"


def common_real(a, b):
    """REAL if nothing wider takes part: no LREAL, no integer of 64 bits."""
    wide = any(t == "LREAL" or (t in INTEGERS and width(t) == 64) for t in (a, b))
    return "LREAL" if wide else "REAL"


def to_integer(value):
    """Half away from zero, saturating in 64 bits; NaN is 0."""
    if value == rational.NAN:
        return 0
    low, high = -(1 << 63), (1 << 63) - 1
    if value[0] == "inf":
        return low if value[1] else high
    return min(max(rational.half_away(value), low), high)


def truncated(a, b):
    quotient = abs(a) // abs(b)
    return -quotient if (a < 0) != (b < 0) else quotient


def literal(number, beside):
    """An integer literal takes the type beside it if that holds it, else the smallest of its own."""
    names = [beside] if beside in INTEGERS else []
    for name in (*names, "INT", "DINT", "LINT", "ULINT"):
        low, high = integer_range(name)
        if low <= number <= high:
            return Value(name, number & MASK)
    raise ValueError(number)


def implicit(source, target):
    """What is said of `x := y`: nothing (`.`), that it may lose information (`w`), that there is no such conversion (`e`)."""
    if source == target:
        return "."
    if source in INTEGERS and target in INTEGERS:
        (low, high), (least, most) = integer_range(source), integer_range(target)
        return "." if least <= low and high <= most else "w"
    if source in INTEGERS and target in REALS:
        return "." if width(source) <= REALS[target][1] + 1 else "w"
    if source in REALS and (target in REALS or target in INTEGERS):
        return "." if target == "LREAL" else "w"
    if source in DURATIONS and target in DURATIONS:
        return "." if target == "LTIME" else "w"
    return "e"


class Language:
    """The operators in one of the two arithmetics."""

    def __init__(self, iec):
        self.iec = iec

    # Conversions.

    def own(self, a):
        """Within the range of its own type."""
        return a if a.type in REALS else Value(a.type, cut(a.type, a.data))

    def convert(self, a, to):
        """`X_TO_Y(a)`."""
        a = self.own(a)
        if a.type == to:
            return a
        if to in REALS:
            if a.type in REALS:
                return Value(to, rational.rounded(a.data, REALS[to]))
            return Value(to, rational.rounded(rational.number(number_of(a.type, a.data)), REALS[to]))
        if a.type in REALS:
            if to == "BOOL":
                return Value(to, int(rational.order(a.data, rational.number(0)) != 0))
            return Value(to, cut(to, to_integer(a.data) & MASK))
        if a.type in TIMES and to in TIMES:
            return Value(to, cut(to, self.between_times(a, to) & MASK))
        return Value(to, cut(to, a.data))

    def between_times(self, a, to):
        """Units change; a day is cut to its beginning, a time of day is what is left of the day."""
        count, unit, target = number_of(a.type, a.data), TIMES[a.type][2], TIMES[to][2]
        if a.type in DATES and to in CLOCKS:
            count %= DAY // unit
        if to in DAYS and a.type not in DAYS:
            count = truncated(count, DAY // unit) * (DAY // unit)
        return truncated(count * unit, target)

    def assign(self, a, to):
        """The bits that `x := a` leaves in an `x` of type `to`."""
        if a.type in REALS or to in REALS or (a.type in TIMES and to in TIMES):
            a = self.convert(a, to)
        bits = width(to)
        if to in REALS:
            return rational.encode(a.data, REALS[to])
        return cut(to, a.data) & ((1 << bits) - 1)

    # Operators.

    def result(self, name, register):
        return Value(name, cut(name, register & MASK) if self.iec else register & MASK)

    def negative(self, a):
        return Value(a.type, rational.negate(a.data)) if a.type in REALS else self.result(a.type, -a.data)

    def invert(self, a):
        return Value(a.type, a.data ^ 1) if a.type == "BOOL" else Value(a.type, cut(a.type, ~a.data & MASK))

    def absolute(self, a):
        if a.type in REALS:
            return Value(a.type, rational.absolute(a.data))
        # A type of 64 bits without sign has nothing to lose; all others fit a register with sign.
        unsigned = shape(a.type) == (64, False)
        return self.result(a.type, a.data if unsigned else abs(as_signed(a.data)))

    def arithmetic(self, sign, a, b):
        if a.type in REALS or b.type in REALS:
            return self.real_arithmetic(sign, a, b)
        return self.result(common(a.type, b.type), self.registers(sign, a, b, shape(common(a.type, b.type)) == (64, False)))

    def registers(self, sign, a, b, unsigned):
        x, y = (a.data, b.data) if unsigned else (as_signed(a.data), as_signed(b.data))
        if sign == "/":
            if y == 0:
                raise Fault
            return truncated(x, y)
        if sign == "MOD":
            return 0 if y == 0 else x - y * truncated(x, y)
        return {"+": x + y, "-": x - y, "*": x * y}[sign]

    def real_arithmetic(self, sign, a, b):
        name = common_real(a.type, b.type)
        x, y = self.convert(a, name).data, self.convert(b, name).data
        result = {
            "+": lambda: rational.add(x, y),
            "-": lambda: rational.add(x, rational.negate(y)),
            "*": lambda: rational.multiply(x, y),
            "/": lambda: rational.divide(x, y),
        }[sign]()
        return Value(name, rational.rounded(result, REALS[name]))

    def compare(self, sign, a, b):
        if a.type in REALS or b.type in REALS:
            name = common_real(a.type, b.type)
            order = rational.order(self.convert(a, name).data, self.convert(b, name).data)
        else:
            x, y = self.alike(a, b)
            order = (x > y) - (x < y)
        truth = order is not None and {
            "=": order == 0, "<": order < 0, "<=": order <= 0, ">": order > 0, ">=": order >= 0, "<>": order != 0,
        }[sign]
        return Value("BOOL", int(truth or (order is None and sign == "<>")))

    def alike(self, a, b):
        """The numbers of two operands that are no REALs, on one scale."""
        if a.type in TIMES and a.type != b.type:
            a, b = self.convert(a, "LTIME"), self.convert(b, "LTIME")
        unsigned = (a.type == b.type and shape(a.type) == (64, False)) or (
            a.type in INTEGERS and shape(common(a.type, b.type)) == (64, False)
        )
        return (a.data, b.data) if unsigned else (as_signed(a.data), as_signed(b.data))

    def bits(self, sign, a, b):
        register = {"AND": a.data & b.data, "OR": a.data | b.data, "XOR": a.data ^ b.data}[sign]
        return Value(a.type if a.type == b.type else common(a.type, b.type), register)

    def shift(self, name, a, n):
        a, count = self.own(a), as_signed(n.data)
        bits, sign = shape(a.type)
        low = a.data & ((1 << bits) - 1)
        beyond = not 0 <= count < bits
        if name == "SHL":
            register = 0 if beyond else a.data << count
        elif name == "SHR":
            register = 0 if beyond else (as_signed(a.data) if sign else a.data) >> count
        else:
            count = (count if name == "ROL" else -count) % bits
            register = low << count | low >> bits - count
        return Value(a.type, cut(a.type, register & MASK))

    def integer_power(self, a, b):
        base, exponent = as_signed(a.data), as_signed(b.data)
        if exponent >= 0:
            return self.result(a.type, pow(base, exponent, 1 << 64))
        return self.result(a.type, {1: 1, -1: 1 if exponent % 2 == 0 else -1}.get(base, 0))

    def power(self, a, b):
        """`EXPT`: LREAL. Told only where the result is exact."""
        x, y = self.convert(a, "LREAL").data, self.convert(b, "LREAL").data
        if x[0] != "num" or y[0] != "num" or rational.signed(y).denominator != 1 or abs(rational.signed(y)) > 64:
            raise Unknown
        if x[2] == 0 and y[2] != 0:
            raise Unknown
        exact = rational.number(rational.signed(x) ** int(rational.signed(y)))
        if rational.rounded(exact, rational.LREAL) != exact:
            raise Unknown
        return Value("LREAL", exact)

    # Choice.

    def common_of(self, a, b):
        if a.type == b.type:
            return a.type
        if a.type in REALS or b.type in REALS:
            return common_real(a.type, b.type)
        return "LTIME" if a.type in TIMES else common(a.type, b.type)

    def as_type(self, a, to):
        """An implicit conversion between operands: what is computed in 64 bits stays so."""
        if a.type == to:
            return a
        if a.type in REALS or to in REALS or a.type in TIMES:
            return self.convert(a, to)
        return Value(to, a.data)

    def extreme(self, name, a, b):
        to = self.common_of(a, b)
        a, b = self.as_type(a, to), self.as_type(b, to)
        return a if self.compare("<=" if name == "MIN" else ">=", a, b).data else b

    def limit(self, low, value, high):
        return self.extreme("MIN", self.extreme("MAX", low, value), high)

    def select(self, g, a, b):
        to = self.common_of(a, b)
        return self.as_type(b if g.data else a, to)

    def multiplex(self, k, *choices):
        number = number_of(k.type, k.data)
        return choices[number if 0 <= number < len(choices) else -1]

    def passed(self, a, to):
        """Given to a function's input."""
        return load(to, self.assign(a, to))

    # Times.

    def span_arithmetic(self, sign, a, b):
        to = a.type if a.type == b.type else "LTIME"
        a, b = self.as_type(a, to), self.as_type(b, to)
        return self.result("LINT" if sign == "/" else to, self.registers(sign, a, b, False))

    def scaled(self, sign, a, b):
        """A duration times or divided by a number."""
        span = a.type if a.type in DURATIONS else b.type
        if a.type in REALS or b.type in REALS:
            return self.convert(self.real_arithmetic(sign, self.convert(a, "LREAL"), self.convert(b, "LREAL")), span)
        return self.result(span, self.registers(sign, a, b, False))

    def difference(self, a, b):
        """Between two dates: a duration."""
        unit = TIMES[a.type][2]
        to = "LTIME" if shape(a.type)[0] == 64 else "TIME"
        return self.result(to, self.result(to, a.data - b.data).data * (unit // TIMES[to][2]))

    def moved(self, sign, a, b):
        """A date and a duration."""
        steps = truncated(as_signed(b.data) * TIMES[b.type][2], TIMES[a.type][2])
        return self.result(a.type, a.data + (steps if sign == "+" else -steps))
