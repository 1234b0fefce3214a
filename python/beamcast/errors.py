"""The exceptions of beamcast, by who can mend what is wrong."""

from __future__ import annotations

from typing import Any


class Error(Exception):
    """What stops beamcast.

    Attributes:
        message: The problem, and what would be right. Of several problems, a line each.
        file: The file that is wrong, or None.
        line: The line of the first error in the file, from 1, or None.
        column: The column of it in characters, from 1, or None.
        key: The key of a job or a sensor file, or the element of a scene, that is wrong, or None.
        help: What would be right, or None.
        problems: All problems, each a dict with `severity`, `code`, `file`, `line`, `column`, `key`, `message` and `help`.
    """

    def __init__(
        self,
        message: str,
        *,
        file: Any = None,
        line: int | None = None,
        column: int | None = None,
        key: str | None = None,
        help: str | None = None,
        problems: list[dict[str, Any]] | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.file = None if file is None else str(file)
        self.line = line
        self.column = column
        self.key = key
        self.help = help
        self.problems = [] if problems is None else problems

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.message,), self.__dict__


class ConfigError(Error, ValueError):
    """A job or a sensor file is wrong."""


class UsageError(Error, ValueError):
    """What is asked for is impossible, such as a frame that does not fit into memory."""


class SceneError(Error, ValueError):
    """A scene can't be read."""


class InputError(Error, ValueError):
    """A file that is to be compared or looked at can't be read."""


class OutputError(Error):
    """An output can't be written."""
