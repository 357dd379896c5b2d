"""Numerical methods that know nothing of rods: Chebyshev series, roots, differences, blocks of points."""
