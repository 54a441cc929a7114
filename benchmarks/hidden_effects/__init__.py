"""Benches with hidden effects from a plant that shares nothing with this project's simulator; `matrix` runs them."""
