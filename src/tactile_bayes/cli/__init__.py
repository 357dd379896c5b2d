"""The command line: parse, call, print."""

from tactile_bayes.cli.app import app, main

__all__ = ["app", "main"]
