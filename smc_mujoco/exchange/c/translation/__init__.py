"""Translate the Python of a law, surface or estimator into C99, operation by operation and with the
same rounding.

numba turns some powers with a constant exponent into products or roots. The C does the same, so
that its results in double precision equal those of the compiled function bit for bit.

`python_source` reads Python, `values` has the types of what C computes, `arrays` and `expressions`
translate what has a value, `statements` what has none, `functions` whole functions, and `c_text`
prints them.
"""
