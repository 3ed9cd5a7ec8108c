"""Diagnosis, the search: which causes are taken, and what describes the rest."""
