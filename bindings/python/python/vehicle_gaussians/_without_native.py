"""Support for the package without its extension module: ``capi`` works, and functions that need the module raise."""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

_NAME = __package__ + "._native"


def complete() -> None:
    """Replaces ``_native``, if it cannot be imported, by a module whose contents raise ``ImportError``."""
    try:
        import_module(_NAME)
    except ImportError as why:
        sys.modules[_NAME] = _Native(why)


class _Native(ModuleType):
    def __init__(self, why: ImportError) -> None:
        super().__init__(_NAME, f"A stand-in: {why}")
        self._why = why

    def __getattr__(self, name: str) -> Any:
        if name == "__version__":
            from . import capi

            return capi.version()
        if name.startswith("__"):
            raise AttributeError(name)
        return _Absent(name, (), {"__module__": __package__, "_why": self._why, "__doc__": _message(name, self._why)})


class _Absent(type):
    """A missing member of the module: a class, so that annotations and ``isinstance`` can name it."""

    _why: ImportError

    def __call__(cls, *arguments: object, **named: object) -> Any:
        raise ImportError(_message(cls.__name__, cls._why)) from cls._why

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise ImportError(_message(f"{cls.__name__}.{name}", cls._why)) from cls._why


def _message(name: str, why: ImportError) -> str:
    return (
        f"{__package__}.{name} needs the extension module {_NAME}, which cannot be imported ({why}); "
        f"{__package__}.capi does the same through ctypes, and an install from a checkout of the repository brings it: "
        "pip install ./bindings/python"
    )


complete()
