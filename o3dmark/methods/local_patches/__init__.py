"""The mark in patches of the surface, each of which tells it; `method` is the way in."""

from o3dmark.methods.local_patches.method import LocalPatches

__all__ = ["LocalPatches"]
