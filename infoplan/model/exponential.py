"""An exponential that loops over it can vectorise."""

import numpy as np

from infoplan.compiled import kernel

# Kernel values below 1e-20 of the variance are far below rounding: zero keeps subnormals away.
_SMALLEST_EXPONENT = -46.05170185988091

_LOG2_E = 1.4426950408889634
# ln 2 in two parts: the product of the first with a small integer is exact.
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# Adding 1.5 * 2^52 leaves the nearest integer in the lowest bits of a double.
_ROUND = 6755399441055744.0


@kernel(fastmath={"contract"})
def _exp(t: float) -> float:
    """Exponential of -700 <= t <= 0, without a call or a branch, so that loops over it vectorise.

    exp(t) = 2^k exp(r) with |r| <= ln(2) / 2: a Taylor polynomial of degree 13 (its remainder is
    below 1e-17 there), and k written into the exponent bits.
    """
    rounded = t * _LOG2_E + _ROUND
    k = rounded - _ROUND
    r = (t - k * _LN2_HIGH) - k * _LN2_LOW
    p = r * (1.0 / 6227020800.0) + 1.0 / 479001600.0
    p = r * p + 1.0 / 39916800.0
    p = r * p + 1.0 / 3628800.0
    p = r * p + 1.0 / 362880.0
    p = r * p + 1.0 / 40320.0
    p = r * p + 1.0 / 5040.0
    p = r * p + 1.0 / 720.0
    p = r * p + 1.0 / 120.0
    p = r * p + 1.0 / 24.0
    p = r * p + 1.0 / 6.0
    p = r * p + 0.5
    p = r * p + 1.0
    p = r * p + 1.0
    bits = (np.float64(rounded).view(np.int64) + 1023) << 52
    return p * np.int64(bits).view(np.float64)


@kernel(fastmath={"contract"})
def exponential(t: float) -> float:
    """exp(t) of a non-positive t, cut to zero where it is negligible."""
    e = _exp(max(t, -700.0))
    return e if t > _SMALLEST_EXPONENT else 0.0
