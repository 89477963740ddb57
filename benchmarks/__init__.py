"""Benchmarks: ratios against simple, honest references in the same run."""
