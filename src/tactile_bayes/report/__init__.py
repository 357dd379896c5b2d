"""The report of a run: one page that says what was found, whether it can be trusted, and how to make it again."""

from tactile_bayes.report.writing import write_report

__all__ = ["write_report"]
