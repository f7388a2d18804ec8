"""The solid that a mesh bounds.

solid       a surface          -> closed, outward, cut into quadrature points
moments     a solid            -> mass, centroid, second and higher moments
frame       a solid            -> origin, scale and axes that follow from its moments
spectrum    quadrature points  -> the Fourier transform of the solid on a band of wave vectors
"""
