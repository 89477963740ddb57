"""What a run contradicts: causes in the rig or its declaration, judged by force and moment, for every estimator."""
