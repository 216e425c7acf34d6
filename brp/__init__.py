"""Bayesian Robot Programming (Lebeltel, Bessiere, Diard, Mazer 2004) as a library: probability, and no robot."""
