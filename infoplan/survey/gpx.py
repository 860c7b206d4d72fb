"""Logs in GPX: track points, else route points, else waypoints, with all that they carry."""

from collections.abc import Iterator
from xml.etree import ElementTree

import pandas as pd

from infoplan.errors import UsageError
from infoplan.survey.raw import RawLog

HELP = "export the track as GPX once more, or as CSV"


def read_gpx(content: bytes, what: str) -> RawLog:
    """Read the points of a GPX file in their order.

    Each element within a point that holds text is a column of its local name, extensions among
    them.

    Parameters
    ----------
    content
        The file.
    what
        What it is called in a message.

    Raises
    ------
    UsageError
        If it is no XML, declares entities, or has no points.
    """
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise UsageError(f"{what} declares entities, which no GPX file does: {HELP}")
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise UsageError(
            f"{what}, line {line}, column {column + 1}: it is no whole XML ({error.msg}): {HELP}"
        ) from error
    points: list[dict[str, str]] = []
    for kind in ("trkpt", "rtept", "wpt"):
        points = [_point(element) for element in root.iter() if _name(element) == kind]
        if points:
            break
    else:
        raise UsageError(f"{what} has no track, route or waypoints: {HELP}")
    units = {"ele": "m"}
    return RawLog(pd.DataFrame(points, dtype=object), [*range(1, len(points) + 1)], "point", units)


def _point(element: ElementTree.Element) -> dict[str, str]:
    """Columns of a point: its attributes, then what lies below it."""
    return {**element.attrib, **dict(_texts(element))}


def _texts(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    for child in element:
        if len(child):
            yield from _texts(child)
        elif child.text and child.text.strip():
            yield _name(child), child.text.strip()


def _name(element: ElementTree.Element) -> str:
    """Local name of an element, its namespace left out."""
    return str(element.tag).rpartition("}")[2]
