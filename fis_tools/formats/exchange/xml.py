"""XML to plain elements with their lines: no document types, no entities, nothing fetched, bounded depth."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import DefusedXMLParser, ParseError

from fis_tools.errors import ControllerFileError
from fis_tools.formats.exchange.foreign import Block

#: How deep elements may be nested; a fuzzy system needs seven levels.
MAX_DEPTH = 32


@dataclass
class Element(Block):
    """An element of a document: a block of its kind, without the namespace, that sets its attributes.

    Parameters
    ----------
    text : str
        What it contains besides elements.
    children : list of Element
        In their order.
    """

    text: str = ""
    children: list["Element"] = field(default_factory=list)

    def all(self, kind: str) -> Iterator["Element"]:
        """Yield the children of one kind."""
        return (child for child in self.children if child.kind == kind)


@dataclass
class _Builder:
    """What the parser reports to."""

    parser: DefusedXMLParser | None = None
    root: Element | None = None
    open: list[Element] = field(default_factory=list)
    comments: list[tuple[int, str]] = field(default_factory=list)

    @property
    def line(self) -> int:
        return int(self.parser.parser.CurrentLineNumber) if self.parser is not None else 0

    def start(self, tag: str, attributes: Mapping[str, str]) -> None:
        settings = {_local(key): (self.line, value) for key, value in attributes.items()}
        element = Element(_local(tag), "", self.line, settings)
        if len(self.open) >= MAX_DEPTH:
            raise ControllerFileError(f"line {self.line}: nested more than {MAX_DEPTH} deep; flatten it")
        if self.open:
            self.open[-1].children.append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        self.open.pop()

    def data(self, text: str) -> None:
        if self.open:
            self.open[-1].text += text

    def comment(self, text: str) -> None:
        self.comments.append((self.line, text))

    def close(self) -> None:
        """Do nothing: the parser asks for it at the end."""


def _local(name: str) -> str:
    return name.rpartition("}")[2]


def read(text: str) -> tuple[Element, list[tuple[int, str]]]:
    """Turn a document into its root element and its comments, each with its line.

    Raises
    ------
    ControllerFileError
        If it is not well-formed XML, has a document type or is nested too deep.
    """
    builder = _Builder()
    builder.parser = DefusedXMLParser(target=builder, forbid_dtd=True)
    try:
        builder.parser.feed(text)
        builder.parser.close()
    except ParseError as error:
        fault = str(error).partition(":")[0]
        raise ControllerFileError(
            f"line {error.position[0]}: it is not XML ({fault}); correct it there, or get a whole copy if it "
            "is cut"
        ) from error
    except DefusedXmlException as error:
        raise ControllerFileError(
            f"line {builder.line}: it has a document type or an entity, which are not read; take them out"
        ) from error
    except (LookupError, ValueError) as error:
        raise ControllerFileError(f"it is not XML ({error}); save it as UTF-8") from error
    if builder.root is None:
        raise ControllerFileError("it is no XML document; get a whole copy")
    return builder.root, builder.comments
