"""Contours of any shape: their prior, the family, and coordinates in which their posterior is nearly normal."""
