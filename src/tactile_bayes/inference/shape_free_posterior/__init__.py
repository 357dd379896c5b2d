"""Posterior of shape-free contours: normal approximation, optimum, and coordinates in which it is nearly normal."""
