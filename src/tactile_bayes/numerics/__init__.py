"""General numerical methods: Chebyshev series, roots, differences, blocks of points."""
