"""Branches of equilibria along a contour, from first contact to snap-off, compiled."""
