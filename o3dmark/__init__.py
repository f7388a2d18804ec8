"""o3dmark hides an ownership mark in 3-D meshes and reads it back after whatever the world did to them.

The public names; each is imported from its module the first time that it is used, so that `import o3dmark` is quick.
"""

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOME = {
    "Key": "keys",
    "Watermark": "watermark",
    "PROFILES": "watermark",
    "METHODS": "methods",
    "ATTACKS": "attacks",
    "attack_all": "attacks",
    "METRICS": "metrics",
    "CODES": "payload",
    "SHAPES": "synthetic",
    "Saliency": "saliency",
    "Surface": "mesh",
    "read_mesh": "files",
    "write_mesh": "files",
    "O3dmarkError": "errors",
    "SpecError": "errors",
    "MeshError": "errors",
    "CapacityError": "errors",
    "KeyFileError": "errors",
    "BackendError": "errors",
}

if TYPE_CHECKING:
    from o3dmark.attacks import ATTACKS, attack_all
    from o3dmark.errors import BackendError, CapacityError, KeyFileError, MeshError, O3dmarkError, SpecError
    from o3dmark.files import read_mesh, write_mesh
    from o3dmark.keys import Key
    from o3dmark.mesh import Surface
    from o3dmark.methods import METHODS
    from o3dmark.metrics import METRICS
    from o3dmark.payload import CODES
    from o3dmark.saliency import Saliency
    from o3dmark.synthetic import SHAPES
    from o3dmark.watermark import PROFILES, Watermark


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*_HOME, "__version__"])


__all__ = [  # noqa: RUF022 (the owner's objects first)
    "Key",
    "Watermark",
    "PROFILES",
    "METHODS",
    "ATTACKS",
    "attack_all",
    "METRICS",
    "CODES",
    "SHAPES",
    "Saliency",
    "Surface",
    "read_mesh",
    "write_mesh",
    "O3dmarkError",
    "SpecError",
    "MeshError",
    "CapacityError",
    "KeyFileError",
    "BackendError",
]
