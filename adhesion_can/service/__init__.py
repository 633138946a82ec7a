"""The service: a core that knows neither bus nor clock, and the loops that run it."""
