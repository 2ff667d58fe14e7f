"""Measurements: from files, from recordings, from readings in memory."""

from __future__ import annotations

import dataclasses
import json
import os
import tempfile
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import _arrays, _nirspi, _table
from ._nirspi import Error
from .hadamard import order


@dataclass(eq=False)
class Measurement:
    """Signed measurements of Hadamard rows, one set or many.

    Give ``d`` (pattern less complement) or ``y`` (readings as they came).

    Parameters
    ----------
    d : array_like, (..., M)
        Differences. NaN: the pattern was not read. Complex numbers are taken.
    y : array_like, (..., 2 M) or (..., M)
        Readings, in the form that ``readings`` says. Drop-outs of pairs are found and become NaN.
    rows : array_like of int, (M,), or str
        The natural-order Hadamard row that was shown k-th; negative: not read. Or the name of an
        order, see :func:`nirspi.order`.
    n : int
        Side of the image, a power of two from 2 to 256.
    readings : {"pairs", "halves", "single"}
        Form of ``y``: pattern, complement, pattern, complement; all patterns, then all complements;
        patterns alone.
    transpose : bool
        Whether pixels are numbered down the columns, as in MATLAB.
    copy : bool
        Whether ``d`` is copied. Without a copy, later changes of the array change the measurement.
    unit : str
        Unit of the readings, for pictures.
    noise : float or array_like, (...,), optional
        Standard deviation of the noise of a value of ``d``, the same for all patterns: one number, or
        one for each measurement; NaN: not known. :func:`reconstruct` weights each reading by it, and
        estimates it if it is not known.
    most_noise : float or array_like, (...,), optional
        What this noise is at most, where it is estimated. Of ``y`` that are patterns with their
        complements it is found, as by :func:`load`: their sums change by noise alone.

    Attributes
    ----------
    d : ndarray of float64 or complex128, (..., M)
    rows : ndarray of int64, (M,)
    n : int
    dropouts : list
        Of each measurement, ``(first reading, readings, rows)`` of each drop-out.
    not_read : ndarray of int64
        Places, in the order shown, of patterns that were not read in any measurement.
    reference : ndarray or None
        The file's own image of the same scene.
    frames : Account or None
        The account of a recording's frames.
    notes : list of str
    origin : dict or None
        Where the readings come from, where that is known: ``origin`` ("simulated", "measured"),
        ``camera`` with its serial and versions, ``file``. Images, pictures and saved files keep it.

    Examples
    --------
    >>> import numpy as np
    >>> import nirspi as ns
    >>> scene = np.arange(64.0).reshape(8, 8)
    >>> split = ns.Hadamard(8, split=True)
    >>> measurement = ns.Measurement(y=split(scene), rows="natural", n=8)
    >>> measurement.d.shape, bool(np.allclose(measurement.d, ns.Hadamard(8)(scene)))
    ((64,), True)
    """

    d: Any = None
    y: dataclasses.InitVar[Any] = None
    rows: Any = None
    n: Any = None
    readings: dataclasses.InitVar[str] = "pairs"
    transpose: dataclasses.InitVar[bool] = False
    copy: dataclasses.InitVar[bool] = True
    unit: str = "units of the readings"
    dropouts: list[Any] = field(default_factory=list)
    not_read: Any = None
    reference: Any = None
    frames: Any = None
    notes: list[str] = field(default_factory=list)
    flat_field: Any = field(default=None, repr=False)
    noise: Any = None
    most_noise: Any = None
    origin: Any = field(default=None, repr=False)

    def __post_init__(self, y: Any, readings: str, transpose: bool, copy: bool) -> None:
        if (self.d is None) == (y is None):
            raise Error(
                "a measurement of d and y, expected one of them"
                if y is not None
                else "a measurement without numbers, expected d or y"
            )
        if self.n is None:
            raise Error("no n, expected the side of the image")
        self.n = _arrays.side(self.n)
        if self.rows is None:
            raise Error("no rows, expected Hadamard rows or the name of an order")
        named = isinstance(self.rows, str)
        rows = order(self.rows, self.n) if named else _arrays.whole_numbers(self.rows, "rows").copy()
        if transpose:
            shown = rows >= 0
            rows[shown] = rows[shown] % self.n * self.n + rows[shown] // self.n
        form = "differences" if y is None else readings
        each = {"pairs": 2, "halves": 2, "single": 1, "differences": 1}.get(form)
        if each is None or (y is not None and form == "differences"):
            raise Error(f'readings is {readings!r}, expected "pairs", "halves" or "single"')
        values = _numbers(self.d if y is None else y, "d" if y is None else "y")
        if named and values.ndim:
            # The name of an order stands for its first patterns.
            rows = rows[: max(values.shape[-1] // each, 1)]
        if values.ndim < 1 or values.shape[-1] != each * len(rows):
            wanted = each * len(rows)
            raise Error(
                f"{'d' if y is None else 'y'} has shape {values.shape}, expected (..., {wanted}):"
                f" {each} a row"
            )
        kept = rows >= 0
        self.not_read = np.flatnonzero(~kept) if self.not_read is None else self.not_read
        self.noise = _deviations(self.noise, "noise", values.shape[:-1])
        self.most_noise = _deviations(self.most_noise, "most_noise", values.shape[:-1])
        if y is not None:
            self._of_readings(values, rows, form)
        else:
            self.rows, self.d = rows[kept], values
            if not kept.all():
                # An index by a mask could give the other memory order.
                self.d = values.compress(kept, axis=-1)
            elif copy:
                self.d = values.copy()
        # The compiled part checks that rows are in range and different.
        _nirspi.Operator(self.n, self.rows, False, False)
        infinite = np.isinf(self.d)
        if infinite.any():
            infinite = np.argwhere(infinite)
            at = ", ".join(str(int(k)) for k in infinite[0])
            raise Error(f"d is {self.d[tuple(infinite[0])]} at [{at}], expected finite numbers")

    def _of_readings(self, values: np.ndarray, rows: np.ndarray, form: str) -> None:
        """Differences of each measurement, with NaN where patterns were not read."""
        if values.dtype.kind == "c":
            raise Error("y is complex, expected real readings: give d")
        count = len(rows)
        each = values.shape[-1] // count
        if form == "halves":
            pairs = values.reshape(-1, each, count).swapaxes(1, 2)
        else:
            pairs = values.reshape(-1, count, each)
        found = np.full((len(pairs), count), np.nan)
        most_noise = np.full(len(pairs), np.nan)
        for frame, one in enumerate(pairs):
            read = (rows >= 0) & ~np.isnan(one).any(axis=1)
            if not read.any():
                raise Error("y has no pattern that was read, expected at least one")
            shown = np.ascontiguousarray(rows[read])
            kept, d, most, lost, notes = _nirspi.readings(
                self.n,
                shown,
                np.ascontiguousarray(one[read]).reshape(-1),
                form,
            )
            at = np.flatnonzero(read)[np.isin(shown, kept)]
            found[frame, at] = d
            most_noise[frame] = np.nan if most is None else most
            self.dropouts.append(lost)
            self.notes.extend(note for note in notes if note not in self.notes)
        shown = rows >= 0
        self.rows = rows[shown]
        self.d = found[:, shown].reshape(*values.shape[:-1], int(shown.sum()))
        if self.most_noise is None:
            self.most_noise = _known(most_noise.reshape(values.shape[:-1]))

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of ``d``."""
        return self.d.shape

    def __len__(self) -> int:
        if self.d.ndim < 2:
            raise TypeError("one measurement has no length")
        return len(self.d)

    def __getitem__(self, index: Any) -> Measurement:
        """Some of several measurements."""
        if self.d.ndim < 2:
            raise IndexError("one measurement, expected several")
        part = self.d[index]
        if part.ndim < 1 or part.shape[-1] != self.d.shape[-1]:
            raise IndexError("an index into the patterns, expected one of measurements")

        def of(name: str) -> Any:
            said = getattr(self, name)
            if said is None or np.ndim(said) == 0:
                return said
            return np.broadcast_to(said[..., np.newaxis], self.d.shape)[index][..., 0]

        dropouts = self.dropouts
        if isinstance(index, (int, np.integer)) and len(dropouts) == len(self.d):
            dropouts = [dropouts[index]]
        return self._with(d=part, dropouts=dropouts, noise=of("noise"), most_noise=of("most_noise"))

    def take(self, count: int) -> Measurement:
        """The first patterns as they were shown."""
        count = _arrays.count(count, "count", least=1) or 1
        return self._with(d=self.d[..., :count], rows=self.rows[:count])

    def _with(self, **changed: Any) -> Measurement:
        kept = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        return Measurement(**(kept | changed))

    @classmethod
    def from_trace(
        cls,
        path: str | os.PathLike[str],
        *,
        rows: Any,
        n: int,
        samples: int | None = None,
        trigger: str | None = None,
        field: str | None = None,
        skip: int = 0,
        settle: int = 0,
        count: int | None = None,
        raw: str | None = None,
        decimal_comma: bool = False,
        readings: str = "pairs",
        transpose: bool = False,
    ) -> Measurement:
        """The measurement of a trace: samples of a detector that were taken while patterns were shown.

        A reading is the mean of the samples of one pattern, as ``nirspi readings`` makes it. What is
        not to be trusted is a ``RuntimeWarning``.

        Parameters
        ----------
        path : path
            A file of any format that :func:`load` reads but a recording, or numbers without a heading.
        rows, n, readings, transpose
            As of :class:`Measurement`.
        samples : int, optional
            Samples of a pattern. With a trigger, its edges must show this number.
        trigger : str, optional
            The field with the trigger's samples: a pattern begins where it rises through the middle of
            its range, with ``NAME:fall`` where it falls, with ``NAME:both`` at every change. One of
            ``samples`` and ``trigger`` is needed.
        field : str, optional
            The field with the detector's samples, of a file with several.
        skip : int
            Samples before the first pattern, to leave out.
        settle : int
            Samples at the beginning of each pattern to leave out, while the light settles.
        count : int, optional
            Readings to keep, for a trace that goes on after the last pattern.
        raw : {"f32", "f64", "i16", "i32"}, optional
            The kind of the little-endian numbers of a file without a heading.
        decimal_comma : bool
            Whether every comma of a text file is a decimal comma.

        Examples
        --------
        >>> import numpy as np, os, tempfile
        >>> import nirspi as ns
        >>> scene = np.arange(64.0).reshape(8, 8)
        >>> y = ns.Hadamard(8, split=True)(scene)
        >>> path = os.path.join(tempfile.mkdtemp(), "adc.f64")
        >>> np.concatenate([np.zeros(7), np.repeat(y, 5)]).tofile(path)
        >>> m = ns.Measurement.from_trace(path, raw="f64", samples=5, skip=7, rows="natural", n=8)
        >>> bool(np.allclose(m.d, ns.Hadamard(8)(scene)))
        True
        """
        if samples is None and trigger is None:
            raise Error("a trace without samples and trigger, expected one of them")
        y, words, origin = _trace(path, samples, trigger, field, skip, settle, count, raw, decimal_comma)
        made = cls(y=y, rows=rows, n=n, readings=readings, transpose=transpose)
        made.origin = origin
        made.notes = [*words, *made.notes]
        return made

    @classmethod
    def from_table(cls, table: Any, **source: Any) -> Measurement:
        """The measurement of a table in memory, such as a data frame of pandas.

        It is read as :func:`load` reads a file with these columns, by the same names, options and
        refusals. Columns that hold words or dates are left out.

        Parameters
        ----------
        table : mapping, data frame or structured array
            Columns of one length by their names; one column may have a single number.
        **source
            The options of :func:`load`.

        Examples
        --------
        >>> import numpy as np
        >>> import nirspi as ns
        >>> scene = np.arange(64.0).reshape(8, 8)
        >>> y = ns.Hadamard(8, split=True)(scene)
        >>> table = {"lit": y[0::2], "dark": y[1::2], "comment": ["ok"] * 64}
        >>> m = ns.Measurement.from_table(table, field="lit,dark", shown="natural")
        >>> bool(np.allclose(m.d, ns.Hadamard(8)(scene)))
        True
        """
        return _of_columns(_table.columns_of(table), "the table", source, None)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes an ``.npz`` that :func:`load` and ``nirspi reconstruct`` read.

        Parameters
        ----------
        path : path
            Name of the file; ``.npz`` is added if it is missing.
        """
        fields: dict[str, Any] = {"n": self.n, "h_row": self.rows, "d": self.d}
        for name in ("noise", "most_noise"):
            said = getattr(self, name)
            if said is not None:
                fields[name] = said
        provenance, simulated = _nirspi.provenance(_origin(self.origin))
        fields["provenance"] = provenance
        if simulated is not None:
            fields["simulated"] = int(simulated)
        if self.reference is not None:
            fields["recon"] = np.asarray(self.reference)
        np.savez(path, **fields)


def _origin(said: Any) -> str | None:
    """Where readings come from, for the compiled part."""
    return None if said is None else json.dumps(said)


def _deviations(said: Any, name: str, leading: tuple[int, ...]) -> float | np.ndarray | None:
    """One standard deviation for all measurements, or one for each; NaN where it is not known."""
    if said is None:
        return None
    values = np.asarray(_arrays.real(said, name), np.float64)
    wrong = ~((values >= 0) & (values < np.inf) | np.isnan(values))
    if wrong.any():
        raise Error(f"{name} is {values[wrong].flat[0]}, expected a standard deviation of 0 or more")
    if values.ndim and values.shape != leading:
        raise Error(f"{name} has shape {values.shape}, expected one number, or {leading}: one a measurement")
    return _known(values.copy())


def _known(values: np.ndarray) -> float | np.ndarray | None:
    """None where nothing is known, one number as a number."""
    if np.isnan(values).all():
        return None
    return values if values.ndim else float(values)


def _numbers(values: Any, name: str) -> np.ndarray:
    array = _arrays.array_of(values, name)
    if array.dtype.kind == "c":
        return np.ascontiguousarray(array, np.complex128)
    return np.ascontiguousarray(_arrays.real(array, name), np.float64)


def _trace(
    path: str | os.PathLike[str],
    samples: int | None,
    trigger: str | None,
    field: str | None,
    skip: int,
    settle: int,
    count: int | None,
    raw: str | None,
    decimal_comma: bool,
) -> tuple[np.ndarray, list[str], dict[str, Any]]:
    """The readings of a trace, what was found, in words, and their origin.

    Doubts are warnings of the caller's caller.
    """
    options = {
        "samples": _arrays.count(samples, "samples", least=1),
        "trigger": trigger,
        "skip": _arrays.count(skip, "skip"),
        "settle": _arrays.count(settle, "settle"),
        "count": _arrays.count(count, "count", least=1),
        "field": field,
        "raw": raw,
        "decimal_comma": bool(decimal_comma),
    }
    y, words, doubts, skipped, taken = _nirspi.trace(os.fspath(path), options)
    for doubt in doubts:
        warnings.warn(doubt, RuntimeWarning, stacklevel=3)
    return y, [*words, *([skipped] if skipped else [])], json.loads(taken)


def _of_columns(
    columns: dict[str, np.ndarray], name: str, source: dict[str, Any], origin: dict[str, Any] | None
) -> Measurement:
    """The measurement of columns in memory, by the reader of files."""
    options = source_options(**source)
    renamed = [part.split("=", 1) for part in (source.get("field") or "").split(",") if "=" in part]
    sides = {"n"} | {own.strip() for called, own in renamed if called.strip() == "n"}
    for own in sides & columns.keys():
        # A column repeats the number in every line.
        if columns[own].size > 1 and (columns[own] == columns[own].flat[0]).all():
            columns[own] = columns[own].reshape(-1)[0]
    with tempfile.TemporaryDirectory() as folder:
        path = _table.write(columns, folder)
        try:
            made = _of_loaded(_nirspi.load(path, options))
            made.origin = origin
            return made
        except Error as error:
            raise Error(str(error).replace(path, name)) from None


def source_options(
    *,
    index: int | str | None = None,
    shown: str | None = None,
    side: int | None = None,
    field: str | None = None,
    readings: str | None = None,
    patterns_first: bool = False,
    transpose: bool = False,
    decimal_comma: bool = False,
    complements_first: bool = False,
    inverted: bool = False,
    shift: int = 0,
    sweeps: int | None = None,
    divide_by_lamp: bool = False,
    part: str = "magnitude",
    keep_leak: bool = False,
    no_flat_field: bool = False,
) -> dict[str, Any]:
    """The options of :func:`load` as the compiled part takes them."""
    return {
        "index": None if index is None else str(index),
        "shown": shown,
        "side": None if side is None else _arrays.side(side),
        "field": field,
        "readings": readings,
        "patterns_first": bool(patterns_first),
        "transpose": bool(transpose),
        "decimal_comma": bool(decimal_comma),
        "complements_first": bool(complements_first),
        "inverted": bool(inverted),
        "shift": int(shift),
        "sweeps": _arrays.count(sweeps, "sweeps", least=1),
        "divide_by_lamp": bool(divide_by_lamp),
        "part": part,
        "keep_leak": bool(keep_leak),
        "no_flat_field": bool(no_flat_field),
    }


def load(
    path: str | os.PathLike[str],
    *,
    index: int | str | None = None,
    shown: str | None = None,
    side: int | None = None,
    field: str | None = None,
    readings: str | None = None,
    patterns_first: bool = False,
    transpose: bool = False,
    decimal_comma: bool = False,
    complements_first: bool = False,
    inverted: bool = False,
    shift: int = 0,
    sweeps: int | None = None,
    divide_by_lamp: bool = False,
    part: str = "magnitude",
    keep_leak: bool = False,
    no_flat_field: bool = False,
) -> Measurement:
    """Reads measurements from a file of nirspi or of another lab, or from a recording.

    The files are those of ``nirspi reconstruct``: ``.npz``, ``.npy``, ``.mat``, HDF5, ``.csv``,
    ``.txt``, ``.mcap``. What does not fit is refused in one line and never guessed.

    Parameters
    ----------
    path : path
    index : int, "all" or None
        Which of several measurements. With "all", each measurement of a file, or each frame of a
        recording; without, the frames of a recording are summed.
    shown : str, optional
        The order in which patterns were shown, for a file without ``h_row``.
    side : int, optional
        Side of the image, for a file that does not say it.
    field : str, optional
        Name of the readings, if it is neither ``y`` nor ``d``; or two names, ``"positive,negative"``.
        Beside them, fields of other names: ``"volts,h_row=order,n=side,sign=polarity"``.
    readings : {"pairs", "halves", "single", "differences"}, optional
        How readings belong to patterns.
    patterns_first : bool
        Whether patterns are along the first axis of the readings.
    transpose : bool
        Whether pixels are numbered down the columns, as in MATLAB.
    decimal_comma : bool
        Whether every comma of a text file is a decimal comma.
    complements_first : bool
        Whether each complement comes before its pattern.
    inverted : bool
        Whether all readings have the other sign, as behind an inverting amplifier.
    shift : int
        Number of first readings of the sweep that the file lacks; -K: K readings came before the sweep.
    sweeps : int, optional
        Number of sweeps of the same patterns in the file, one after another.
    divide_by_lamp : bool
        Whether readings are divided by the lamp's level, against a lamp that drifts or flickers: of pairs
        by their sums, of readings without complements by those of the all-on pattern, if it was shown at
        least four times over the sweep. Ambient light makes this correction too weak.
    part : {"magnitude", "real", "imaginary"}
        Of complex readings: "magnitude" keeps both parts (``d`` is complex).
    keep_leak : bool
        Whether the leak between patterns of a recording stays.
    no_flat_field : bool
        Whether the flat field kept for a recording's camera is ignored.

    Returns
    -------
    Measurement

    Raises
    ------
    FileNotFoundError, OSError
        If the system refuses the file.
    Error
        If the content is wrong: one line with the file, the field, what was found and expected.

    Examples
    --------
    >>> import numpy as np, os, tempfile
    >>> import nirspi as ns
    >>> path = os.path.join(tempfile.mkdtemp(), "wing.npz")
    >>> ns.Measurement(d=np.arange(16.0), rows="zig-zag", n=4).save(path)
    >>> ns.load(path).rows[:4].tolist()
    [0, 2, 8, 12]
    """
    options = source_options(
        index=index,
        shown=shown,
        side=side,
        field=field,
        readings=readings,
        patterns_first=patterns_first,
        transpose=transpose,
        decimal_comma=decimal_comma,
        complements_first=complements_first,
        inverted=inverted,
        shift=shift,
        sweeps=sweeps,
        divide_by_lamp=divide_by_lamp,
        part=part,
        keep_leak=keep_leak,
        no_flat_field=no_flat_field,
    )
    return _of_loaded(_nirspi.load(os.fspath(path), options))


def read(
    path: str | os.PathLike[str],
    *,
    samples: int | None = None,
    trigger: str | None = None,
    skip: int = 0,
    settle: int = 0,
    count: int | None = None,
    raw: str | None = None,
    **source: Any,
) -> Measurement:
    """Reads whatever holds a measurement: a file or a recording as :func:`load` does, or a trace.

    With ``samples`` or ``trigger`` the file is a trace: its samples make readings first, as in
    :meth:`Measurement.from_trace`. What these readings are, the options of :func:`load` say.

    Parameters
    ----------
    path : path
    samples, trigger, skip, settle, count, raw
        As of :meth:`Measurement.from_trace`.
    **source
        The options of :func:`load`. The ``field`` of a trace is that of its samples.

    Examples
    --------
    >>> import numpy as np, os, tempfile
    >>> import nirspi as ns
    >>> scene = np.arange(64.0).reshape(8, 8)
    >>> y = ns.Hadamard(8, split=True)(scene)
    >>> folder = tempfile.mkdtemp()
    >>> np.save(os.path.join(folder, "y.npy"), y)
    >>> np.save(os.path.join(folder, "adc.npy"), np.repeat(y, 5))
    >>> one = ns.read(os.path.join(folder, "y.npy"), shown="natural")
    >>> two = ns.read(os.path.join(folder, "adc.npy"), samples=5, shown="natural")
    >>> bool(np.allclose(one.d, two.d))
    True
    """
    if samples is None and trigger is None:
        of_trace = {"skip": skip, "settle": settle, "count": count, "raw": raw}
        given = [name for name, value in of_trace.items() if value not in (None, 0)]
        if given:
            raise Error(f"{given[0]} without samples and trigger, expected one of them: it is of a trace")
        return load(path, **source)
    field, comma = source.pop("field", None), source.pop("decimal_comma", False)
    y, words, origin = _trace(path, samples, trigger, field, skip, settle, count, raw, comma)
    made = _of_columns({"y": y}, os.fspath(path), source, origin)
    made.notes = [*words, *made.notes]
    return made


def _of_loaded(found: _nirspi.Loaded) -> Measurement:
    """What the compiled part has read and checked, which is not checked again."""
    from .camera import Account

    leading = () if found.count is None else (found.count,)
    imaginary, references, frames = found.imaginary, found.references, found.frames
    d = found.d if imaginary is None else found.d + 1j * imaginary
    made = object.__new__(Measurement)
    made.rows, made.n = found.rows, found.n
    made.d = d.reshape(*leading, len(made.rows))
    made.unit = "units of the readings" if frames is None else "ADC counts"
    made.dropouts = found.dropouts
    made.not_read = np.asarray(found.not_read, np.int64)
    made.reference = None if references is None else references.reshape(*leading, made.n, made.n)
    made.frames = None if frames is None else Account(*frames)
    made.flat_field, made.notes = found.flat_field, found.notes
    made.origin = json.loads(found.taken)
    if found.damage is not None:
        made.notes.insert(0, found.damage)
        warnings.warn(found.damage, RuntimeWarning, stacklevel=3)
    for name in ("noise", "most_noise"):
        said = getattr(found, name)
        setattr(made, name, None if said is None else _known(np.reshape(said, leading)))
    return made
