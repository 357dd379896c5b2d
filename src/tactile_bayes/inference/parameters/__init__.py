"""Parameters that are inferred, and their priors."""
