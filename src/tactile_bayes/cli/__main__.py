"""`python -m tactile_bayes.cli`."""

from tactile_bayes.cli import main

main()
