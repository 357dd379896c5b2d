"""Poses of a rod under a force, compiled."""
