"""Tables as instruments write them: what their columns mean, the map, and the recording that they become."""
