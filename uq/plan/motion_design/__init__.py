"""The motion of least predicted uncertainty: of a platform on six legs, of a robot arm."""
