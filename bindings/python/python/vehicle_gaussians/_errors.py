"""What goes wrong, with the numbers of the C library."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """Why a call did not do what it was asked. The numbers are those of ``include/vg.h`` and do not change."""

    OK = 0
    #: An argument is outside what the function accepts.
    ARGUMENT = 1
    #: A file's content is not what its format promises.
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
    #: Something is needed that this machine does not have.
    MISSING = 8
    #: The operating system did not start the threads that were asked for.
    THREADS = 9


class VgError(Exception):
    """What the library says when it cannot: which argument or file, what was found, what is allowed."""

    #: Which kind of failure.
    code: Status

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        # A library newer than this file may know more.
        self.code = Status(code) if code in list(Status) else Status.INTERNAL

    def __reduce__(self) -> tuple[type[VgError], tuple[int, str]]:
        return type(self), (int(self.code), str(self))
