"""Figures of a check: none, its findings are words and numbers."""
