"""Planning a measurement: duration, sensors, static poses, motion files, what the platform really did."""
