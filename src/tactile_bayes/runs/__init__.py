"""Runs: everything that a command makes, in one folder of files."""
