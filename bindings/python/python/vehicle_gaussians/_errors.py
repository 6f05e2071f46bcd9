"""Errors with the status codes of the C library, as subclasses of Python's own exceptions."""

from __future__ import annotations

import enum
import os
import re


class Status(enum.IntEnum):
    """Status codes of failed calls. The numbers are those of ``include/vg.h`` and do not change."""

    OK = 0
    #: An argument is outside what the function accepts.
    ARGUMENT = 1
    #: The contents of a file are invalid for its format.
    FORMAT = 2
    #: The operating system refused a file operation.
    IO = 3
    #: The input is well formed, but no vehicle can be made of it.
    RECONSTRUCTION = 4
    #: The progress function asked to stop.
    CANCELLED = 5
    #: This build leaves the function out.
    NOT_BUILT = 6
    #: A defect of the library.
    INTERNAL = 7
    #: A resource is missing on this machine.
    MISSING = 8
    #: The operating system did not start the requested threads.
    THREADS = 9


class VgError(Exception):
    """Base class of the library's errors. The message names the argument or file, what was found, what is allowed.

    ``VgError(code, message)`` makes an object of the code's subclass, which also derives from the matching Python
    exception:

    >>> isinstance(VgError(Status.ARGUMENT, "threads: -1; allowed: 0 (all cores) to 1024"), ValueError)
    True
    """

    code: Status
    """Kind of failure."""

    def __new__(cls, code: int, message: str) -> VgError:
        made = _class_of(code, message) if cls is VgError else cls
        return super(VgError, made).__new__(made, message)

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        # A newer library may have more codes.
        self.code = Status(code) if code in list(Status) else Status.INTERNAL

    def __str__(self) -> str:
        return str(self.args[0])

    def __reduce__(self) -> tuple[type[VgError], tuple[int, str]]:
        return type(self), (int(self.code), str(self))


class ArgumentError(VgError, ValueError):
    """An argument of the right kind with a value that is not accepted (ARGUMENT)."""


class ArgumentTypeError(VgError, TypeError):
    """An argument of the wrong kind (ARGUMENT)."""


class FormatError(VgError, ValueError):
    """The contents of a file are invalid for its format (FORMAT)."""


class FileError(VgError, OSError):
    """The operating system refused a file operation (IO); ``errno``, ``strerror`` and ``filename`` are set if the
    system reported an error number."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.errno = _errno(message)
        if self.errno is not None:
            self.strerror = os.strerror(self.errno)
            name, words, _ = message.partition(f": {self.strerror} (os error {self.errno})")
            self.filename = name if words else None


class FileMissingError(FileError, FileNotFoundError):
    """A file or a folder does not exist (IO)."""


class FileForbiddenError(FileError, PermissionError):
    """A file or a folder is not readable or not writable (IO)."""


class ReconstructionError(VgError, RuntimeError):
    """The input is well formed, but no vehicle can be made of it (RECONSTRUCTION)."""


class CancelledError(VgError):
    """The progress function asked to stop (CANCELLED)."""


class NotBuiltError(VgError, NotImplementedError):
    """This build leaves the function out (NOT_BUILT)."""


class InternalError(VgError, RuntimeError):
    """A defect of the library (INTERNAL)."""


class MissingError(VgError, RuntimeError):
    """A resource is missing on this machine (MISSING)."""


class ThreadsError(VgError, RuntimeError):
    """The operating system did not start the requested threads (THREADS)."""


_CLASSES: dict[int, type[VgError]] = {
    Status.ARGUMENT: ArgumentError,
    Status.FORMAT: FormatError,
    Status.RECONSTRUCTION: ReconstructionError,
    Status.CANCELLED: CancelledError,
    Status.NOT_BUILT: NotBuiltError,
    Status.INTERNAL: InternalError,
    Status.MISSING: MissingError,
    Status.THREADS: ThreadsError,
}


def _class_of(code: int, message: str) -> type[VgError]:
    if code != Status.IO:
        return _CLASSES.get(code, VgError if code in list(Status) else InternalError)
    # OSError maps the number to its subclass.
    of_system = type(OSError(_errno(message), ""))
    named: dict[type[OSError], type[FileError]] = {
        FileNotFoundError: FileMissingError,
        PermissionError: FileForbiddenError,
    }
    return named.get(of_system, FileError)


def _errno(message: str) -> int | None:
    """The system's error number at the end of a message: "no.ply: No such file or directory (os error 2)"."""
    found = re.search(r"\(os error (\d+)\)", message)
    return int(found.group(1)) if found else None
