"""Reference ridges: synthetic scans with exact answers, a scorer, and the campaigns that measure by them."""
