"""The mark in function space; `method` is the way in."""

from o3dmark.methods.shape_spectrum.method import ShapeSpectrum

__all__ = ["ShapeSpectrum"]
