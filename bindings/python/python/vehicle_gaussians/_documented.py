"""Fields of tuples with docstrings of their own, which ``help`` shows as editors do."""

from __future__ import annotations

import ast
import inspect
import sys
from typing import TypeVar

T = TypeVar("T")


def documented(cls: type[T]) -> type[T]:
    """Gives the fields of a named tuple the strings that follow them in the source."""
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
        # Without sources there are names and types.
        return {}
    found: dict[str, dict[str, str]] = {}
    for cls in tree.body:
        if isinstance(cls, ast.ClassDef):
            for field, text in zip(cls.body, cls.body[1:], strict=False):
                match field, text:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(said))):
                        found.setdefault(cls.name, {})[name] = inspect.cleandoc(said)
    return found
