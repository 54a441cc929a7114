"""The numerical core: segments, their simulation, least squares within bounds, noise, uncertainty."""
