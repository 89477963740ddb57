"""Serial arms: how joints move the tool, what drives them, what a wrist sensor learns of the payload."""
