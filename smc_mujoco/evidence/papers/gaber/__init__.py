"""J. Gaber, Observer-Free Sliding Mode Control via Structured Decomposition: the study of its laws,
and its Lyapunov function. Its claims are in benchmarks/papers/gaber.
"""
