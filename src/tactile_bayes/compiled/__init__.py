"""The forward model as compiled code, for likelihoods that are asked for ten thousands of times.

The same path that `tactile_bayes.path` follows with arrays, one contour at a time and without friction, for contours
whose halves have a formula (`Contour.halves`); the arrays are what it is tested against. numba is imported, and the
code compiled or fetched from numba's cache, when `loads` is first imported.
"""
