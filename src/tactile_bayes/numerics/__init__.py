"""General numerical methods: Chebyshev series, roots, differences, blocks and selections of points, random numbers."""
