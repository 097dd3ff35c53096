"""One law per file, formula first; found by walking this package.

Letters: e = x - r and de = v - r' are the tracking error and its rate, s the sliding variable, u the commanded control
before saturation, sgn(0) = 0, and [a]^p = |a|^p sgn(a); _ is a sample earlier, + a sample later.

Formulas stand as they are published, for s' = u + d: model-free, u is what they say. With a scenario's model="nominal"
it is the acceleration that they ask for beyond eq, which keeps s constant: u = (eq + "u" - f + r'') / g.

Default gains follow one rule, so that a law works on every plant without tuning and none is favoured; a file that
departs from it says why:
- |u| <= U = 6 N or N m is the study's bound: what switches, k, asks for at most U, and for 2 to 4 where another term
  of the law asks too, or where the law chatters with k: the sum may exceed U while |s| is large.
- c = 2.5 /s is the slope of the laws' own s: U holds a unit mass on it from 2 m on (c^2 2 m = 12.5 N is needed on it,
  but it is reached at less).
- L = 4 N/s is the rate of the disturbance that super-twisting laws are made for: k1 = 1.5 sqrt(L), k2 = 1.1 L.
- Adaptive gains begin at 0 where the law can grow from there; layers and dead zones are 0.02 to 0.5 wide in s, m/s or
  rad/s, and times are 2 s.
Whatever the rule gives is held to one thing: on each plant from its own x0, with |u| <= 6, 1 ms and 10 s, with the
model and without, the ultimate bound is at most 5 % of the initial error (tests/control/test_laws_catalogue.py).
"""
