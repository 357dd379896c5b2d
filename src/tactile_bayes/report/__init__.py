"""The report of a run: one page with its results, their diagnostics, and the way to reproduce them."""

from tactile_bayes.report.writing import write_report

__all__ = ["write_report"]
