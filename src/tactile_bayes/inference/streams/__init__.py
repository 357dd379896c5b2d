"""Posteriors of a growing record."""
