"""Whether usd-core can read a binary layer, tried in a process of its own.

On a damaged one it takes gigabytes, minutes, or the process with it.
"""

import subprocess
import sys
from pathlib import Path

from o3dmark.errors import MeshError

_SECONDS = 20  # and one more for each of so many bytes:
_BYTES_PER_SECOND = 2_000_000
_CHILD = """
import os, sys
from pxr import Sdf, Usd
path, seconds = sys.argv[1], int(sys.argv[2])
try:
    import resource
    with open("/proc/self/status") as status:
        taken = next(int(line.split()[1]) << 10 for line in status if line.startswith("VmData"))
    memory = taken + 10 * os.path.getsize(path) + (256 << 20)
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))  # address space would count what is never used
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
except (ImportError, OSError):  # a system without such limits
    pass
layer = Sdf.Layer.FindOrOpen(path)
def visit(at):
    spec = layer.GetObjectAtPath(at)
    for key in spec.ListInfoKeys() if spec else ():
        spec.GetInfo(key)
layer.Traverse("/", visit)
layer.GetCompositionAssetDependencies(), layer.ListAllTimeSamples()
layer.customLayerData, layer.documentation, layer.comment
Sdf.Layer.CreateAnonymous(".usdc").TransferContent(layer)
stage = Usd.Stage.Open(layer)
for prim in stage.TraverseAll():
    prim.GetTypeName(), prim.HasVariantSets()
    for attribute in prim.GetAttributes():
        attribute.Get(), attribute.GetNumTimeSamples()
        [(spec.path, spec.HasInfo("default")) for spec in attribute.GetPropertyStack()]
"""


def check_binary(name: str, path: Path) -> None:
    """Errors: MeshError for a layer that cannot be read within ten times its size and 256 MiB, or in good time."""
    seconds = _SECONDS + path.stat().st_size // _BYTES_PER_SECOND
    try:
        done = subprocess.run(
            [sys.executable, "-c", _CHILD, str(path), str(seconds)],
            capture_output=True,
            timeout=2 * seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise MeshError(f"{name} is damaged: it takes for ever to read") from None
    if done.returncode:
        raise MeshError(f"{name} is damaged: it cannot be read, or not within ten times its size and 256 MiB")
