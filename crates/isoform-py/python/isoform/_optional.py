"""Packages that are taken where they are installed."""

from __future__ import annotations

import importlib
from typing import Any


def need(name: str) -> Any:
    """A package, or an error that says how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as e:
        package = name.partition(".")[0]
        raise ImportError(f"this needs the package {package}: pip install {package}") from e
