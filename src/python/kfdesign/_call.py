"""The way to the native module: objects become paths or lent names, what comes back becomes a result."""

from __future__ import annotations

import errno
import functools
import inspect
import json
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from difflib import get_close_matches
from types import TracebackType
from typing import TYPE_CHECKING, Any, ParamSpec, Protocol, TypeVar

from . import _native
from .errors import KfdesignError

if TYPE_CHECKING:
    from .log import Log

P = ParamSpec("P")
R = TypeVar("R")

StrPath = str | os.PathLike[str]
#: False: silent. True: a bar. A function hears ``(stage, done, parts)``; what it raises ends the work.
Progress = bool | Callable[[str, int, int], object]

#: How a log is read: keywords of read_log.
READING = ("topic", "columns", "sensor", "unit", "rate", "time", "start", "end", "input")

_threads: int | None = None


def set_threads(count: int | None) -> None:
    """Do all further work on so many threads; the results do not depend on it.

    Parameters
    ----------
    count : int or None
        None: as many as the machine has.

    Examples
    --------
    >>> import kfdesign as kf
    >>> kf.set_threads(None)
    """
    global _threads
    if count is not None and not 1 <= count <= 1024:
        raise KfdesignError(f"threads {count}: expected 1 to 1024")
    _threads = count


def suggesting(function: Callable[P, R]) -> Callable[P, R]:
    """An unknown keyword is answered with the one that may be meant."""
    parameters = inspect.signature(function).parameters
    known = [name for name, one in parameters.items() if one.kind is one.KEYWORD_ONLY]

    @functools.wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> R:
        for name in kwargs:
            if name not in parameters:
                close = get_close_matches(name, known, 1)
                hint = f"did you mean '{close[0]}'?" if close else f"expected {', '.join(known)}"
                if name in READING:
                    hint = f"read_log(FILE, {name}=...) takes it and gives a log for {function.__name__}()"
                raise TypeError(f"{function.__name__}() has no keyword '{name}'; {hint}")
        return function(*args, **kwargs)

    return called


class Source(Protocol):
    """Where the texts of a result come from."""

    @property
    def json(self) -> str: ...
    @property
    def file(self) -> str | None: ...
    @property
    def notes(self) -> tuple[str, ...]: ...
    def shown(self, name: str) -> str | None: ...


@dataclass(frozen=True)
class Kept:
    """Texts of a result that has been somewhere else, such as in a pickle."""

    json: str
    file: str | None = None
    notes: tuple[str, ...] = ()
    texts: Mapping[str, str | None] = field(default_factory=dict)

    def shown(self, name: str) -> str | None:
        return self.texts.get(name)


class Made:
    """A result that the native module still has; its texts are made when they are wanted."""

    def __init__(self, outcome: _native.Outcome, folder: str | None) -> None:
        self._outcome = outcome
        self._folder = folder
        self.json = self._own(outcome.json)
        self.notes = tuple(map(self._own, outcome.notes))

    def _own(self, text: str) -> str:
        # what was lent as a file is called by its name alone: the folder is gone when this is read
        return text.replace(self._folder + os.sep, "") if self._folder else text

    @property
    def file(self) -> str | None:
        text = self._outcome.file
        return None if text is None else self._own(text)

    @property
    def files(self) -> list[tuple[str | None, str]]:
        return [(name, self._own(text)) for name, text in self._outcome.files]

    def shown(self, name: str) -> str | None:
        text = self._outcome.shown(name)
        return None if text is None else self._own(text)


def existing(path: StrPath) -> str:
    """The path of a file that is there, as text."""
    text = os.fspath(path)
    if not isinstance(text, str):
        raise TypeError(f"expected a path as str or os.PathLike, found {type(path).__name__}")
    writable(text)
    if not os.path.exists(text):
        raise FileNotFoundError(errno.ENOENT, "there is no such file", text)
    return text


def writable(path: StrPath) -> str:
    """A path as text that a document can name."""
    text = os.fspath(path)
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        raise KfdesignError(f"{text!r}: the name is not UTF-8, so no document can name it; rename the file") from None
    return text


class Call(AbstractContextManager["Call"]):
    """One call: collects what is lent, and has a folder for what must be a file, until it is over."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._lent: list[Any] = []

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def place(self, name: str) -> str:
        """A path for a file that lives as long as the call."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="kfdesign-")
        path = os.path.join(self._folder.name, name)
        stem, ending = os.path.splitext(name)
        count = 1
        while os.path.exists(path):
            count += 1
            path = os.path.join(self._folder.name, f"{stem}-{count}{ending}")
        return path

    def document(self, what: object, name: str) -> str:
        """The path of a document: its own, or that of a file for this call."""
        text = getattr(what, "_document_text", None)
        if text is None:
            if isinstance(what, (str, os.PathLike)):
                return existing(what)
            raise TypeError(f"expected {name} as a path or an object of this package, found {type(what).__name__}")
        origin = getattr(what, "origin", None)
        if origin is not None and os.path.exists(origin):
            with open(origin, encoding="utf-8") as file:
                if file.read() == text():
                    return str(origin)
        path = self.place(name)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text())
        return path

    def log(self, log: Log) -> str:
        """The name by which a request finds the log."""
        if log.path is not None:
            return log.path
        names = [own[0] for own in self._lent]
        name, count = log.name, 1
        while name in names:
            count += 1
            name = f"{log.name} {count}"
        self._lent.append((name, *log._lent()))
        return name

    def run(
        self, name: str, request: Mapping[str, Any] | str, progress: Progress = False, threads: int | None = None
    ) -> Made:
        with Bar.of(progress) as listener:
            given: object = request
            if not isinstance(request, str):
                given = {key: value for key, value in request.items() if value is not None}
            folder = None if self._folder is None else self._folder.name
            try:
                text = json.dumps(given)
                outcome = _native.run(name, text, self._lent, listener, _threads if threads is None else threads)
            except KfdesignError as error:
                if folder is None:
                    raise
                raise type(error)(str(error).replace(folder + os.sep, "")) from None
        return Made(outcome, folder)

    def read(self, log: str, reading: Mapping[str, Any], data: bool) -> tuple[dict[str, Any], list[str], list[bytes]]:
        """What is in a log; where wished, its axes and its time."""
        text, notes, columns = _native.log(json.dumps([log, reading]), self._lent, data)
        return json.loads(text), notes, columns


class Bar:
    """A bar on stderr; where tqdm is installed, its own, which notebooks show."""

    def __init__(self) -> None:
        self._stage = ""
        self._bar: Any = None

    @staticmethod
    def of(progress: Progress) -> AbstractContextManager[Callable[[str, int, int], object] | None]:
        return _Heard(Bar() if progress is True else progress or None)

    def __call__(self, stage: str, done: int, parts: int) -> None:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            share = min(done / parts, 1.0)
            sys.stderr.write(f"\r{stage} [{'#' * round(30 * share):30}] {share:4.0%}")
            sys.stderr.flush()
            self._stage = stage
            return
        if stage != self._stage or self._bar is None or self._bar.total != parts:
            self.close()
            self._stage, self._bar = stage, tqdm(total=parts, desc=stage)
        self._bar.update(min(done, parts) - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None
        elif self._stage:
            sys.stderr.write("\n")
        self._stage = ""


class _Heard(AbstractContextManager[Callable[[str, int, int], object] | None]):
    def __init__(self, listener: Any) -> None:
        self._listener = listener

    def __enter__(self) -> Callable[[str, int, int], object] | None:
        heard: Callable[[str, int, int], object] | None = self._listener
        return heard

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(self._listener, Bar):
            self._listener.close()


def text_of(value: object) -> str:
    """A keyword that takes a number or a text with its unit."""
    return value if isinstance(value, str) else repr(value)


def number_of(value: float | str | None, unit: str, keyword: str) -> float | None:
    """A number in this unit of a text with a unit, or as it is."""
    if value is None or not isinstance(value, str):
        return value
    text = value.strip()
    end = next((at for at, c in enumerate(text) if not (c.isdigit() or c in "+-.eE")), len(text))
    # the e of 1e3 is of the number, that of "e" is of a unit
    while end and not (text[end - 1].isdigit() or text[end - 1] == "."):
        end -= 1
    try:
        number, found = float(text[:end]), text[end:].strip()
    except ValueError:
        raise KfdesignError(f"{keyword} {value!r}: expected a number with a unit, such as '10 {unit}'") from None
    if not found:
        return number
    (factor, dimension), (own, expected) = _native.unit(found), _native.unit(unit)
    if dimension != expected:
        raise KfdesignError(f"{keyword} {value!r}: expected {expected}, found {dimension}")
    return number * factor / own


def texts(values: Sequence[object] | Mapping[str, object] | str | None) -> list[str]:
    """A list of texts: of one, of several, or NAME=VALUE of a mapping."""
    if values is None:
        return []
    if isinstance(values, str):
        return [values]
    if isinstance(values, Mapping):
        return [f"{name}={_joined(value)}" for name, value in values.items()]
    return [str(value) for value in values]


def _joined(value: object) -> str:
    return ",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
