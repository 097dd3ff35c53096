"""Bodies, springs and obstacles that plants share."""
