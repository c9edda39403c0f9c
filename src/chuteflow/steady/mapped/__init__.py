"""The paper's own method, Chebyshev series in a mapped height: second and independent."""
