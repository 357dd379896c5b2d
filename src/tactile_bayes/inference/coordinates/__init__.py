"""Coordinates in which parameters are sampled."""
