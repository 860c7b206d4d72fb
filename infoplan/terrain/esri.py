"""Elevations from ESRI ASCII grids (.asc), read here: GDAL's reader takes words for numbers."""

import codecs
import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np

from infoplan.errors import UsageError
from infoplan.terrain import grids
from infoplan.terrain.grids import Block, Edges, Floats, Grid, Resampled
from infoplan.terrain.texts import MAX_TEXT, refusal
from infoplan.wording import harmless

HEADER = 4096
"""Most bytes of a header."""
CHUNK = 2**22
"""Bytes that are parsed at once."""

KEYS = ("ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx",
        "dy", "nodata_value")  # fmt: skip
NODATA = -9999.0
"""What marks a missing elevation where the header does not say it, by the format's definition."""

PAIR = re.compile(rb"\s*([A-Za-z_]+)[ \t]+(\S+)")
# Of these alone the numbers consist, and nan; what Python would read besides, 1_000, is left out.
OTHER = re.compile(rb"[^0-9+\-.eEnNaA\s]")


@dataclass
class Header:
    """What the first lines say: the numbers by their names in lower case, and where they end."""

    numbers: dict[str, float]
    end: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return int(self.numbers["nrows"]), int(self.numbers["ncols"])

    @property
    def nodata(self) -> float:
        """What marks a missing elevation."""
        return self.numbers.get("nodata_value", NODATA)

    def edges(self) -> Edges | None:
        """West, east, south and north of the whole; None if the corner is not told."""
        size = self.numbers.get("cellsize", math.nan)
        dx, dy = self.numbers.get("dx", size), self.numbers.get("dy", size)
        west = self.numbers.get("xllcorner", self.numbers.get("xllcenter", math.nan) - dx / 2)
        south = self.numbers.get("yllcorner", self.numbers.get("yllcenter", math.nan) - dy / 2)
        rows, columns = self.shape
        edges = west, west + columns * dx, south, south + rows * dy
        return edges if all(map(math.isfinite, edges)) else None


def read_asc(
    stream: BinaryIO, what: str, shape: list[int] | None, mark: float | None
) -> tuple[Grid, Resampled | None, bool]:
    """Read an ESRI ASCII grid, in double precision.

    Parameters
    ----------
    stream
        The file.
    what
        What it is called in a message.
    shape
        Rows and columns that a grid of more than `MAX_NODES` nodes is resampled to while it is
        read; None: it is refused.
    mark
        A number that stands for a missing elevation besides the header's, in such a grid.

    Returns
    -------
    grid : Grid
        The south first; NaN where the file has no data.
    resampled : Resampled or None
        What was seen of a grid that was resampled while it was read.
    single : bool
        Whether every elevation is the same in single precision.

    Raises
    ------
    UsageError
        If the header or an elevation is wrong; names line and column.
    """
    stream = _as_bytes(stream, what)
    header = _header(stream, what)
    rows, columns = header.shape
    size = stream.seek(0, io.SEEK_END)
    if 2 * rows * columns - 1 > size - header.end:
        raise UsageError(
            f"{what} is cut short: it announces {rows} x {columns} nodes and has {size} bytes, "
            "so copy or download it again"
        )
    body = _Body(stream, header, what)
    elevation, resampled = grids.read_in(header.shape, shape, mark, what, body.blocks())
    return Grid(elevation[::-1], None, header.edges()), resampled, body.single


def _as_bytes(stream: BinaryIO, what: str) -> BinaryIO:
    """Return the text in an encoding whose digits are ASCII."""
    start = stream.read(4)
    if start in (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE):
        raise UsageError(f"{what} is a text in UTF-32: save it as UTF-8")
    if not start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return stream
    stream.seek(0)
    content = stream.read(MAX_TEXT + 1)
    try:
        if len(content) > MAX_TEXT:
            raise UnicodeError("too long")
        return io.BytesIO(content.decode("utf-16").encode())
    except UnicodeError as error:
        raise UsageError(
            f"{what} is a text in UTF-16, damaged or too long: save it as UTF-8"
        ) from error


def _header(stream: BinaryIO, what: str) -> Header:
    stream.seek(0)
    content = stream.read(HEADER)
    end = len(codecs.BOM_UTF8) if content.startswith(codecs.BOM_UTF8) else 0
    numbers: dict[str, float] = {}
    while (found := PAIR.match(content, end)) and found[1].decode().lower() in KEYS:
        key, text = found[1].decode().lower(), found[2].decode("latin-1")
        end = found.end()
        reason = refusal(text)
        if reason is None:
            numbers[key] = float(text)
            reason = _wrong(key, numbers[key])
        if reason:
            place = _place(stream, found.start(2))
            raise UsageError(
                f"the header of {what} is wrong, {place}: {found[1].decode()} {harmless(text)}: "
                f"{reason}"
            )
    absent = [key for key in KEYS[:2] if key not in numbers]
    if not {"cellsize"} & numbers.keys() and not {"dx", "dy"} <= numbers.keys():
        absent.append("cellsize")
    if absent:
        raise UsageError(
            f"{what} is not a readable ESRI ASCII grid, or it is damaged or cut short: its first "
            f"lines do not give {', '.join(absent)} (they are ncols, nrows, xllcorner, yllcorner, "
            "cellsize, NODATA_value, each with a number)"
        )
    return Header(numbers, end)


def _wrong(key: str, number: float) -> str | None:
    if key == "nodata_value":
        return None
    if not math.isfinite(number):
        return "it must be a finite number"
    if key in ("ncols", "nrows") and not (
        2 <= number <= grids.MAX_STORED_NODES and number % 1 == 0
    ):
        return f"it must be a whole number, at least 2 and at most {grids.MAX_STORED_NODES}"
    if key in ("cellsize", "dx", "dy") and number <= 0:
        return "it must be above 0"
    return None


@dataclass
class _Body:
    """The elevations after a header, in rows from the north, and what is seen on the way."""

    stream: BinaryIO
    header: Header
    what: str
    single: bool = True
    count: int = 0
    lines: int = 0
    uneven: list[tuple[int, int]] = field(default_factory=list)
    """The first line with another number of elevations than a row has: its place, how many."""
    _open: int = 0

    def blocks(self) -> Iterator[Block]:
        """Go through the rows; at the end, check how many there were."""
        rows, columns = self.header.shape
        done, rest = 0, np.empty(0)
        for values in self._values():
            rest = np.concatenate([rest, values])
            whole = len(rest) // columns
            if done + whole > rows:
                raise UsageError(self._miscounted(more=True))
            if whole:
                yield done, 0, rest[: whole * columns].reshape(whole, columns)
                done, rest = done + whole, rest[whole * columns :].copy()
        if len(rest) or done < rows:
            raise UsageError(self._miscounted(more=done == rows))
        # As many lines as rows: then each is a row, and none may lack what another has too much.
        if self.lines == rows and self.uneven:
            raise UsageError(self._miscounted())

    def _values(self) -> Iterator[Floats]:
        at, carried = self.stream.seek(self.header.end), b""
        while chunk := self.stream.read(CHUNK):
            last = len(chunk) < CHUNK
            chunk, at = carried + chunk, at - len(carried)
            cut = len(chunk)
            if not last:
                cut = 1 + max(chunk.rfind(space) for space in (b" ", b"\n", b"\t", b"\r"))
                if cut == 0:
                    raise UsageError(self._no_number(at, chunk[:40]))
            yield self._parsed(chunk[:cut], at)
            carried, at = chunk[cut:], at + len(chunk)
        if carried:
            yield self._parsed(carried, at - len(carried))
        self._close(at)

    def _parsed(self, chunk: bytes, at: int) -> Floats:
        try:
            if OTHER.search(chunk):
                raise ValueError
            values = np.array(chunk.split(), dtype=np.float64)
            if np.isinf(values).any():
                raise ValueError
        except ValueError:
            raise UsageError(self._fault(chunk, at)) from None
        self._count(chunk, at)
        values = grids.marked(values, self.header.nodata)
        with np.errstate(over="ignore"):
            rounded = values.astype(np.float32)
        self.single = self.single and np.array_equal(values, rounded, equal_nan=True)
        return values

    def _count(self, chunk: bytes, at: int) -> None:
        """Count the numbers of each line, in one go for all."""
        codes = np.frombuffer(chunk, dtype=np.uint8)
        blank = (codes <= 13) | (codes == 32)
        starts = ~blank & np.concatenate([[True], blank[:-1]])
        self.count += int(starts.sum())
        ends = np.flatnonzero((codes == 10) | (codes == 13))
        before = np.concatenate([[0], np.cumsum(starts)[ends]])
        lines = np.diff(before)
        if len(lines):
            lines[0] += self._open
            self._open = 0
        self._open += int(starts.sum() - before[-1])
        full = lines[lines > 0]
        self.lines += len(full)
        if not self.uneven and (odd := np.flatnonzero((lines > 0) & (lines != self.columns))).size:
            self.uneven.append((at + int(ends[odd[0]]), int(lines[odd[0]])))

    def _close(self, at: int) -> None:
        """Count a last line that has no end."""
        if self._open:
            self.lines += 1
            if not self.uneven and self._open != self.columns:
                self.uneven.append((at, self._open))

    @property
    def columns(self) -> int:
        return self.header.shape[1]

    def _miscounted(self, more: bool | None = None) -> str:
        rows, columns = self.header.shape
        message = f"{self.what} is not whole" if not more else f"{self.what} holds too much"
        message += f": its header announces {rows} rows of {columns} elevations"
        if more is False:
            message += f", and it is cut short or lacks some, there are {self.count}"
        if self.uneven:
            place, found = self.uneven[0]
            message += f", and {_place(self.stream, place).partition(',')[0]} has {found}"
        elif more:
            message += f", and it has more than {rows * columns}"
        return f"{message}; correct it, or copy or download it again"

    def _fault(self, chunk: bytes, at: int) -> str:
        for found in re.finditer(rb"\S+", chunk):
            text = found.group().decode("utf-8", errors="replace")
            if refusal(text):
                return self._no_number(at + found.start(), found.group())
        return f"{self.what} is not a readable ESRI ASCII grid"

    def _no_number(self, at: int, text: bytes) -> str:
        reason = refusal(text.decode("utf-8", errors="replace"))
        return (
            f"{self.what} holds something else than elevations, {_place(self.stream, at)}: "
            f"{reason}: correct it, or write the header's NODATA_value where one is missing"
        )


def _place(stream: BinaryIO, offset: int) -> str:
    """Line and column of a byte, as an editor counts them."""
    stream.seek(0)
    line, read, last, tail = 1, 0, b"", b""
    while chunk := stream.read(min(CHUNK, offset - read)):
        # A line ends with a line feed, a carriage return or both, maybe in two chunks.
        joined = last + chunk
        line += joined.count(b"\n") + joined.count(b"\r") - joined.count(b"\r\n")
        line -= last in (b"\n", b"\r")
        cut = max(chunk.rfind(b"\n"), chunk.rfind(b"\r")) + 1
        tail = chunk[cut:] if cut else tail + chunk
        read, last = read + len(chunk), chunk[-1:]
    if line == 1:
        tail = tail.removeprefix(codecs.BOM_UTF8)
    return f"line {line}, column {len(tail.decode('utf-8', errors='replace')) + 1}"
