"""Coverage: intervals and regions from trials, the adaptive procedure."""
