"""One law per file, formula first; found by walking this package.

Letters: e = x - r and de = v - r' are the tracking error and its rate, s the sliding variable, u the commanded control
before saturation, sgn(0) = 0, and [a]^p = |a|^p sgn(a).
"""
