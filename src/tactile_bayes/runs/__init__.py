"""Runs: the results of a command, in one folder of files."""
