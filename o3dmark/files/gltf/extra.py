"""Libraries that reading a compressed file needs, and that not everybody has installed."""

import importlib
from typing import Any

from o3dmark.errors import MeshError


def library(name: str, where: str) -> Any:
    """A module of the extra "pipeline". Errors: MeshError, which says that ``where`` needs it, and how to get it."""
    try:
        return importlib.import_module(name)
    except (ImportError, OSError):
        raise MeshError(
            f'{where} is compressed, and {name} is not installed: pip install "o3dmark[pipeline]"'
        ) from None
