"""What a law bears: margins, regions of attraction, worst cases, sensitivity to uncertainty."""
