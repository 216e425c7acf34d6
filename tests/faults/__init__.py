"""Faults on purpose: the injector itself, and what a client makes of what it does."""
