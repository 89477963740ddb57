"""Errors of gyro, accelerometer and their stamps."""
