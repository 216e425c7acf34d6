"""Speed, measured and printed: `python -m benchmarks`."""
