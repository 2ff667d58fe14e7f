"""Brings arrays into the type and memory order that the compiled part takes. An array that has both
is not copied."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._nirspi import Error


def array_of(values: Any, name: str) -> np.ndarray:
    """An array of anything. What is masked was not read, so it is NaN. What has DLPack and no other way
    into NumPy is taken by DLPack."""
    if isinstance(values, np.ma.MaskedArray):
        return _unmasked(values)
    others = ("__array__", "__array_interface__", "__array_struct__", "__buffer__")
    if hasattr(values, "__dlpack__") and not any(hasattr(values, other) for other in others):
        try:
            return np.from_dlpack(values)
        except (BufferError, RuntimeError, TypeError, ValueError) as error:
            raise Error(f"{name} is no array of the processor: {error}") from None
    try:
        return np.asarray(values)
    except (ValueError, TypeError) as error:
        raise Error(f"{name} is no array: {error}") from None


def _unmasked(values: np.ma.MaskedArray) -> np.ndarray:
    """The array with NaN in masked places. One without masked places keeps its type."""
    if not np.ma.is_masked(values) or values.dtype.kind not in "biufc":
        return np.ma.getdata(values)
    return np.where(np.ma.getmaskarray(values), np.nan, np.ma.getdata(values))


def real(values: Any, name: str) -> np.ndarray:
    """An array of real numbers of any type."""
    array = array_of(values, name)
    if array.dtype.kind not in "biuf":
        raise Error(f"{name} holds {array.dtype}, expected real numbers")
    if array.dtype.itemsize > 8:
        raise Error(f"{name} holds {array.dtype}, expected real numbers of up to 8 bytes")
    return array


def flat(values: Any, name: str, dtype: Any) -> np.ndarray:
    """The same numbers as one contiguous axis of this type."""
    return np.ascontiguousarray(real(values, name), dtype=dtype).reshape(-1)


def floating(values: Any, name: str) -> np.ndarray:
    """The array in float32, or in float64 if float32 cannot hold its type."""
    array = real(values, name)
    return np.ascontiguousarray(array, dtype=np.result_type(array.dtype, np.float32))


def no_out(out: Any, beside: str) -> None:
    """Refuses ``out`` where the result is no array of NumPy's real numbers."""
    if out is not None:
        raise Error(f"out beside {beside}, expected none")


def place(out: Any, shape: tuple[int, ...], values: np.ndarray, name: str) -> None:
    """Refuses an ``out`` into which the result of these values cannot be written."""
    if not isinstance(out, np.ndarray):
        raise Error(f"out is a {type(out).__name__}, expected a NumPy array")
    if out.shape != shape or out.dtype != values.dtype:
        raise Error(f"out has shape {out.shape} of {out.dtype}, expected {shape} of {values.dtype}")
    if not (out.flags.c_contiguous and out.flags.writeable):
        raise Error("out is read-only or not contiguous, expected memory to write to, rows first")
    if np.may_share_memory(out, values):
        raise Error(f"out shares memory with {name}, expected memory of its own")


def whole_numbers(values: Any, name: str) -> np.ndarray:
    """One axis of int64. Numbers with a fraction are refused."""
    array = real(values, name)
    if array.ndim != 1:
        raise Error(f"{name} has shape {array.shape}, expected one axis")
    if array.dtype.kind == "f":
        wrong = np.flatnonzero(~(np.isfinite(array) & (array == np.trunc(array))))
        if wrong.size:
            raise Error(f"{name} is {array[wrong[0]]} at [{wrong[0]}], expected whole numbers")
    if array.dtype.kind == "u" and array.size and array.max() > np.iinfo(np.int64).max:
        raise Error(f"{name} is {array.max()}, expected at most {np.iinfo(np.int64).max}")
    return np.ascontiguousarray(array, dtype=np.int64)


def side(n: Any) -> int:
    """A whole number as the side of an image. The compiled part checks its range."""
    try:
        value = int(n)
    except (TypeError, ValueError, OverflowError):
        raise Error(f"n is {n!r}, expected a power of two from 2 to 256") from None
    if value != n or value < 0 or value > 2**63:
        raise Error(f"an image side of {n} pixels: expected a power of two from 2 to 256")
    return value


def square_images(values: Any, name: str) -> np.ndarray:
    """Images ``(..., n, n)`` of float32, at least one."""
    array = np.ascontiguousarray(real(values, name), dtype=np.float32)
    if array.ndim < 2 or array.shape[-1] != array.shape[-2] or array.size == 0:
        raise Error(f"{name} has shape {array.shape}, expected (..., n, n)")
    return array


def share(value: Any) -> str:
    """A share of the patterns as the command line reads it: 0.3 or "30%"."""
    return value if isinstance(value, str) else repr(float(value))


def count(value: Any, name: str, *, least: int = 0) -> int | None:
    """A whole number of at least ``least``, or None."""
    if value is None:
        return None
    try:
        number = int(value)
    except (TypeError, ValueError, OverflowError):
        raise Error(f"{name} is {value!r}, expected a whole number") from None
    if number != value or number < least or number > 2**32 - 1:
        raise Error(f"{name} is {value}, expected a whole number from {least} to {2**32 - 1}")
    return number
