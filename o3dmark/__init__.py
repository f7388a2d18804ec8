"""o3dmark hides an ownership mark in 3-D meshes and reads it back after whatever the world did to them.

The public names stand in ``__init__.pyi``; each is imported when it is first used, so `import o3dmark` is quick.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
