"""Docstrings of the fields of tuples, for ``help`` and editors."""

from __future__ import annotations

import ast
import inspect
import sys
from typing import TypeVar

T = TypeVar("T")


def documented(cls: type[T]) -> type[T]:
    """Sets the docstrings of a named tuple's fields to the strings that follow them in the source."""
    for field, text in field_texts(cls).items():
        getattr(cls, field).__doc__ = text
    return cls


def field_texts(cls: type) -> dict[str, str]:
    """The strings that follow the fields of a class in the source."""
    if cls.__module__ not in _TEXTS:
        _TEXTS[cls.__module__] = _texts(cls.__module__)
    return _TEXTS[cls.__module__].get(cls.__name__, {})


#: Strings after fields, by module, class and field.
_TEXTS: dict[str, dict[str, dict[str, str]]] = {}


def _texts(module: str) -> dict[str, dict[str, str]]:
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except OSError:
        # Without sources, the fields have names and types only.
        return {}
    found: dict[str, dict[str, str]] = {}
    for cls in tree.body:
        if isinstance(cls, ast.ClassDef):
            for field, string in zip(cls.body, cls.body[1:], strict=False):
                match field, string:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                        found.setdefault(cls.name, {})[name] = inspect.cleandoc(text)
    return found
