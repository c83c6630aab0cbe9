"""The root of an XML file."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from geodesic_ocp.errors import RecordingError


def xml_root(file: Path) -> ElementTree.Element:
    """The root element of an XML file without entities.

    Raises:
        RecordingError: the XML is broken, or defines entities, which can expand to more than memory
            holds; names the line.
        OSError: the file cannot be read.
    """
    try:
        _refuse_entities(file)
        return ElementTree.parse(file).getroot()
    except ElementTree.ParseError as failure:
        line, column = failure.position
        reason = str(failure).partition(": line ")[0]  # which names the place once more
        raise RecordingError(
            f"{file}: broken XML at line {line}, column {column}: {reason}; is the file cut off?"
        ) from None
    except RecordingError:
        raise
    except (LookupError, ValueError) as failure:
        raise RecordingError(f"{file}: broken XML: {failure}") from None


def _refuse_entities(file: Path) -> None:
    parser = expat.ParserCreate()

    def refuse(name: str, *_: object) -> None:
        raise RecordingError(
            f"{file}: line {parser.CurrentLineNumber} defines the entity {name!r}, which is not "
            "supported"
        )

    parser.EntityDeclHandler = refuse
    with file.open("rb") as stream, suppress(expat.ExpatError):  # reported by ElementTree
        parser.ParseFile(stream)
