"""Optional dependencies."""

from __future__ import annotations

import importlib
from typing import Any


def need(name: str) -> Any:
    """Import a package, or raise an error that states how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError as e:
        package = name.partition(".")[0]
        raise ImportError(f"this needs the package {package}: pip install {package}") from e
