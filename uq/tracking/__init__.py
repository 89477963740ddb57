"""What a platform really ran: a recorded run beside its plan, the point that was to keep still, the prediction."""
