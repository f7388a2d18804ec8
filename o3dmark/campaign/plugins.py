"""Plug-ins: Python files that register methods, attacks, metrics, codes or shapes of one's own."""

import hashlib
import importlib.util
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from o3dmark.errors import SpecError


@dataclass(frozen=True)
class Plugin:
    """A Python file with the SHA-256 of its content, which is what counts."""

    path: str
    digest: str

    @classmethod
    def of(cls, path: str | Path) -> "Plugin":
        """The plug-in in a file. Errors: SpecError when it cannot be read."""
        try:
            return cls(str(Path(path).resolve()), hashlib.sha256(Path(path).read_bytes()).hexdigest())
        except OSError as error:
            raise SpecError(f"cannot read the plug-in {Path(path).name}: {error.strerror}") from None

    @property
    def public(self) -> "Plugin":
        """The same without the folder."""
        return Plugin(Path(self.path).name, self.digest)


def load_plugins(plugins: Iterable[Plugin]) -> None:
    """Run each file, once in a process, whatever its folder.

    Errors: SpecError when it fails, or is not the file that the campaign was planned with.
    """
    for plugin in plugins:
        module = f"o3dmark_plugin_{plugin.digest[:16]}"
        if module in sys.modules:
            continue
        if Plugin.of(plugin.path).digest != plugin.digest:
            raise SpecError(f"{plugin.public.path} is not the plug-in that the campaign was planned with")
        _run(plugin, module)


def _run(plugin: Plugin, module: str) -> None:
    spec = importlib.util.spec_from_file_location(module, plugin.path)
    if spec is None or spec.loader is None:
        raise SpecError(f"the plug-in {plugin.public.path} is no Python file; its name should end in .py")
    sys.modules[module] = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(sys.modules[module])
    except Exception as error:
        del sys.modules[module]
        raise SpecError(f"the plug-in {plugin.public.path} fails: {type(error).__name__}: {error}") from error
