"""Where walkers start, and the coordinates in which they move."""
