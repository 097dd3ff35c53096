"""J.

Gaber, Observer-Free Sliding Mode Control via Structured Decomposition: the study and the audit of
its claims.
"""
