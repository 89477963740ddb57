"""Serial arms: kinematics, efforts, what a wrist sensor learns of the payload."""
