"""Planning: the motion to run, how long, with which sensors and static poses."""
