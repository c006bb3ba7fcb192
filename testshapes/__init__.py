"""Damaged shapes and random bodies with known correspondences, for tests and experiments."""
