"""Planning a measurement: duration, sensors, static poses."""
