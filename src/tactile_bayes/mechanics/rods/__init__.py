"""Rods as they are stated or traced."""
