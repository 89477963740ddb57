"""What a run contradicts: causes in the rig or its declaration, by force and moment."""
