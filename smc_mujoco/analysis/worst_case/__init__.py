"""The worst case within a class of disturbances and parameters: the class, its adversaries, and the
search.
"""
