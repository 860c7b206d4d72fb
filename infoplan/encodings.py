"""In which encoding a user's text is."""

import codecs
import io

from infoplan.errors import UsageError


def encoding_of(content: bytes, what: str, advice: str) -> str:
    """Name the encoding of a text: UTF-8, UTF-16 with its mark, or Latin-1.

    Parameters
    ----------
    content
        The text.
    what
        What it is called in a message.
    advice
        What to do about a file that is no text.

    Raises
    ------
    UsageError
        If it is no text, or a damaged one.
    """
    # Its mark begins with that of UTF-16.
    if content.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise UsageError(f"{what} is a text in UTF-32: save it as UTF-8")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        if not _decodes(content, "utf-16"):
            raise UsageError(f"{what} is a damaged text in UTF-16: save it as UTF-8")
        return "utf-16"
    start = content[:2000]
    if b"\0" in start:
        zeros = [start[side::2].count(0) for side in (0, 1)]
        if min(zeros) == 0 and max(zeros) > len(start) // 3:
            raise UsageError(f"{what} is a text in UTF-16 without its mark: save it as UTF-8")
        raise UsageError(f"{what} is no text: {advice}")
    # Whatever else it is, Latin-1 reads it.
    return "utf-8-sig" if content.isascii() or _decodes(content, "utf-8-sig") else "latin-1"


def _decodes(content: bytes, encoding: str) -> bool:
    try:
        for _ in io.TextIOWrapper(io.BytesIO(content), encoding=encoding):
            pass
    except UnicodeError:
        return False
    return True
