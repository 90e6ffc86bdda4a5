"""Numbers from whatever holds them (arrays of any layout, lists, columns of a data frame), refused with what was found and what was expected."""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np

#: Kinds of numpy's types that are numbers; truth values, words and dates are none.
REAL, COMPLEX = "iuf", "iufc"


def numbers(values: Any, name: str, kind: type = np.float64) -> np.ndarray:
    """An array of `kind` in the shape of `values`: itself where it is one already, of its own memory where it must be converted.

    `TypeError` for what is no number, `ValueError` for masked values, which would come in as if they had been measured.
    """
    expected = "real numbers" if kind is np.float64 else "numbers"
    try:
        found = np.asanyarray(values)
    except ValueError as e:
        # Lists of unequal length.
        raise ValueError(f"{name}: {e}; expected {expected} in one shape") from None
    if isinstance(found, np.ma.MaskedArray):
        masked = int(np.ma.count_masked(found))
        if masked:
            raise ValueError(f"{name}: found {masked} masked values of {found.size}; expected none, so leave them out")
    found = np.asarray(found)
    if found.size == 0 and found.dtype.kind == "O":
        # An empty column of a data frame has no type.
        return found.astype(kind)
    if found.dtype.kind == "O":
        return each(found, name, kind, expected)
    if found.dtype.kind not in (REAL if kind is np.float64 else COMPLEX):
        raise TypeError(f"{name}: found {found.dtype}; expected {expected}")
    return found.astype(kind, copy=False)


def each(found: np.ndarray, name: str, kind: type, expected: str) -> np.ndarray:
    """Objects, one by one: numbers of Python and of numpy are taken."""
    made = np.empty(found.shape, kind)
    flat = made.ravel()
    for i, value in enumerate(found.ravel()):
        try:
            if value is None or isinstance(value, (str, bytes, bool)):
                raise TypeError
            flat[i] = value
        except (TypeError, ValueError):
            raise TypeError(f"{name}: value {i}: found {value!r}; expected {expected}") from None
    return made


def vector(values: Any, name: str, kind: type = np.float64) -> np.ndarray:
    """n numbers side by side in memory; `ValueError` for another number of dimensions."""
    found = numbers(values, name, kind)
    if found.ndim != 1:
        raise ValueError(f"{name}: found the shape {found.shape}; expected one dimension, (n,)")
    return np.ascontiguousarray(found)


def finite(values: Any, name: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """Real numbers side by side, and the shape that they came in; `ValueError` for one that is not finite."""
    found = numbers(values, name)
    flat = np.ascontiguousarray(found.ravel())
    if not np.isfinite(flat).all():
        i = int(np.flatnonzero(~np.isfinite(flat))[0])
        raise ValueError(f"{name}: value {i}: found {flat[i]}; expected a finite number")
    return flat, found.shape


def count(value: Any, name: str) -> int:
    """A whole number of at least 0."""
    try:
        found = operator.index(value)
    except TypeError:
        raise TypeError(f"{name}: found {value!r}; expected a whole number") from None
    if found < 0:
        raise ValueError(f"{name}: found {found}; expected a whole number of at least 0")
    return found


def pair(value: Any, name: str) -> tuple[float, float]:
    """Two ascending numbers above 0."""
    try:
        low, high = map(float, value)
    except (TypeError, ValueError):
        raise ValueError(f"{name}: found {value!r}; expected two numbers, (low, high)") from None
    if not (0.0 < low <= high < math.inf):
        raise ValueError(f"{name}: found ({low}, {high}); expected two finite numbers, 0 < low <= high")
    return low, high
