"""The solid that a mesh bounds.

closing     a surface          -> wound outward, holes closed
solid       a surface          -> the solid that it bounds
quadrature  a solid            -> points with area vectors, for integrals over its surface
moments     a solid            -> mass, centroid, second and higher moments
frame       a solid            -> origin, scale and axes that follow from its moments
spectrum    quadrature points  -> the Fourier transform of the solid on a band of wave vectors
"""
