"""Laws of many joints, one per file. Every module of this package is searched for laws.

Notation. x, e = x - r, de = v - r', s and u are vectors with one number for each joint, and the
mechanism is M(x) x'' + h(x, v) = u + d, with h = C(x, v) v + g(x) + damping. M, h, C and g in a law
are nominal. s = de + c e unless a file says otherwise. Products of gains with vectors are element
by element. A gain has one number for each joint, unless a file says that it is shared. With the
perfect model, u = M (v + r'') + h gives e'' = v + M^-1 d.
"""
