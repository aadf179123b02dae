"""Probabilistic and mixture models of movements."""
