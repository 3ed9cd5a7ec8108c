"""Diagnosis, one cause beside a fit: its variants, its score, the model fitted with it."""
