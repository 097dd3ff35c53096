"""J. Gaber, Observer-Free Sliding Mode Control via Structured Decomposition: its Lyapunov function.
Its claims are in benchmarks/papers/gaber.
"""
