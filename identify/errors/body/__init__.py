"""Errors of what is stated of the body: mass, centre of gravity, and that it is one rigid body."""
