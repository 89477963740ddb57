"""Other people's conventions of axes, signs, units and zeros: a run's mechanics tell which of them it follows."""
