"""Control laws and C: laws written in C run in the callback, and laws of this library written out
as C.
"""
