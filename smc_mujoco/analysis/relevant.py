"""Which lead of a law counts, by default: apart from the statistics, which a command's help does
without.
"""

RELEVANT = 0.03  # r, default share of the larger value that is relevant; chosen
