"""Control laws, one per file. Every module of this package is searched for laws.

Notation. e = x - r and de = v - r' are the tracking error and its rate, s is the sliding variable,
u the commanded control before saturation, g the input gain, d the matched disturbance, |d| <= D,
and dt the control period. sgn(0) = 0 and [a]^p = |a|^p sgn(a). A trailing _ means one sample
earlier, a trailing + one sample later. A law is r-sliding if it brings its sliding variable and the
first r - 1 derivatives of it to 0 in finite time.

Formulas are as published, for s' = u + d. Without a model u is the formula itself. With a
scenario's model="nominal" the formula is an acceleration, added to the acceleration v_eq that keeps
s constant:

    u = (v_eq + formula - f + r'') / g

Units are those of a sliding joint. For a rotating joint read rad for m and N m for N. With the
nominal model u is an acceleration inside the law: read m/s^2 for N.

Default gains follow one rule, so that each law works on every plant without tuning and none is
favoured. A file that departs from the rule says why.
- |u| <= U = 6 N or N m is the bound of the study. A switching gain k is at most U. It is 2 to 4 if
another term of the law adds to it, or if the law chatters with k; the sum may exceed U while |s| is
large.
- c = 2.5 /s is the slope of the surface s = de + c e. Keeping a unit mass on this surface takes c^2
|e|, 12.5 N at 2 m, but the surface is reached at smaller errors.
- L = 4 N/s is the rate of the disturbance that super-twisting laws are designed for: k1 = 1.5
sqrt(L), k2 = 1.1 L.
- Adaptive gains start at 0 if the law can grow from there. Layers and dead zones of s are 0.02 to
0.5 m/s wide, and times are 2 s.

One test applies to all defaults (tests/control/test_laws_catalogue.py): on each plant, from its own
x0, with |u| <= 6, a period of 1 ms, a duration of 10 s, with the model and without, the ultimate
bound is at most 5 % of the initial error.
"""
