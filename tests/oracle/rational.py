"""Binary floating point in exact rational arithmetic: every result is rounded once, to nearest, ties to even.

A value is ("nan",), ("inf", sign) or ("num", sign, magnitude); the sign is 0 or 1, the magnitude a Fraction, so that zero has a sign too.
"""

from fractions import Fraction
from math import isqrt

REAL = (8, 23)
LREAL = (11, 52)
NAN = ("nan",)


def number(fraction, sign=0):
    """A finite value; `sign` is that of a zero."""
    if fraction == 0:
        return ("num", sign, Fraction(0))
    return ("num", int(fraction < 0), abs(Fraction(fraction)))


def signed(value):
    """The Fraction of a finite value."""
    return -value[2] if value[1] else value[2]


def decode(bits, form):
    exponent_bits, mantissa_bits = form
    sign = bits >> (exponent_bits + mantissa_bits) & 1
    exponent = bits >> mantissa_bits & ((1 << exponent_bits) - 1)
    mantissa = bits & ((1 << mantissa_bits) - 1)
    bias = (1 << (exponent_bits - 1)) - 1
    if exponent == (1 << exponent_bits) - 1:
        return NAN if mantissa else ("inf", sign)
    if exponent == 0:
        return ("num", sign, Fraction(mantissa) * Fraction(2) ** (1 - bias - mantissa_bits))
    return ("num", sign, Fraction(mantissa | 1 << mantissa_bits) * Fraction(2) ** (exponent - bias - mantissa_bits))


def half_even(fraction):
    whole = fraction.numerator // fraction.denominator
    rest = fraction - whole
    return whole + int(rest > Fraction(1, 2) or (rest == Fraction(1, 2) and whole % 2 == 1))


def encode(value, form):
    """The bits of the value rounded to the form; every NaN is the same one."""
    exponent_bits, mantissa_bits = form
    top = (1 << exponent_bits) - 1
    if value == NAN:
        return top << mantissa_bits | 1 << (mantissa_bits - 1)
    sign = value[1] << (exponent_bits + mantissa_bits)
    if value[0] == "inf":
        return sign | top << mantissa_bits
    magnitude = value[2]
    if magnitude == 0:
        return sign
    bias = (1 << (exponent_bits - 1)) - 1
    exponent = magnitude.numerator.bit_length() - magnitude.denominator.bit_length()
    if magnitude < Fraction(2) ** exponent:
        exponent -= 1
    exponent = max(exponent, 1 - bias)
    # A carry out of the mantissa runs into the exponent, where it belongs.
    scaled = half_even(magnitude / Fraction(2) ** (exponent - mantissa_bits))
    bits = scaled + (exponent + bias - 1 << mantissa_bits)
    return sign | min(bits, top << mantissa_bits)


def rounded(value, form):
    return decode(encode(value, form), form)


def negate(a):
    return a if a == NAN else (a[0], 1 - a[1], *a[2:])


def absolute(a):
    return a if a == NAN else (a[0], 0, *a[2:])


def add(a, b):
    if NAN in (a, b):
        return NAN
    if a[0] == "inf" or b[0] == "inf":
        if a[0] == b[0]:
            return a if a[1] == b[1] else NAN
        return a if a[0] == "inf" else b
    return number(signed(a) + signed(b), a[1] & b[1] if a[2] == 0 and b[2] == 0 else 0)


def multiply(a, b):
    if NAN in (a, b):
        return NAN
    sign = a[1] ^ b[1]
    if a[0] == "inf" or b[0] == "inf":
        zero = any(v[0] == "num" and v[2] == 0 for v in (a, b))
        return NAN if zero else ("inf", sign)
    return ("num", sign, a[2] * b[2])


def divide(a, b):
    if NAN in (a, b):
        return NAN
    sign = a[1] ^ b[1]
    if a[0] == "inf":
        return NAN if b[0] == "inf" else ("inf", sign)
    if b[0] == "inf":
        return ("num", sign, Fraction(0))
    if b[2] == 0:
        return NAN if a[2] == 0 else ("inf", sign)
    return ("num", sign, a[2] / b[2])


def order(a, b):
    """-1, 0 or 1; None if one is a NaN."""
    if NAN in (a, b):
        return None
    far = Fraction(2) ** 2000
    x, y = ((-far if v[1] else far) if v[0] == "inf" else signed(v) for v in (a, b))
    return (x > y) - (x < y)


def whole(a, how):
    """`floor`, `ceil` or `trunc`; the sign of a zero is the operand's."""
    if a[0] != "num":
        return a
    fraction = signed(a)
    low = fraction.numerator // fraction.denominator
    high = low if low == fraction else low + 1
    result = {"floor": low, "ceil": high, "trunc": high if a[1] else low}[how]
    return number(result, a[1])


def half_away(a):
    """The nearest integer of a finite value, halves away from zero."""
    magnitude = (2 * a[2] + 1).numerator // (2 * (2 * a[2] + 1).denominator)
    return -magnitude if a[1] else magnitude


def square_root(a, form):
    """Rounded once: the root of a number with far more digits than the form, with a sticky digit."""
    if a == NAN or (a[1] and not (a[0] == "num" and a[2] == 0)):
        return NAN
    if a[0] == "inf" or a[2] == 0:
        return a
    shift = 2 * (form[1] + 1200)
    scaled = (a[2].numerator << shift) // a[2].denominator
    root = isqrt(scaled)
    exact = root * root == scaled and (scaled * a[2].denominator == a[2].numerator << shift)
    return rounded(("num", 0, Fraction(2 * root + (0 if exact else 1), 1 << (shift // 2 + 1))), form)
