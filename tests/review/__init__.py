"""Recorded runs, looked at, asked again and compared."""
