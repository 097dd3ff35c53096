"""Velocity estimators, one per file. Every module of this package is searched for estimators.

Notation: x is the measured position, v the velocity, dt or h the control period. A trailing _ means
one sample earlier, a trailing + one sample later; [a]^p = |a|^p sgn(a). Units are those of a
sliding joint: for a rotating joint read rad for m.
"""
