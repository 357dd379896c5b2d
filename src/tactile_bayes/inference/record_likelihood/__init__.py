"""The likelihood of a whole record."""
