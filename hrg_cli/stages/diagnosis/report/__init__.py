"""Diagnosis, what is said: the record and the JSON of a verdict or of a refusal."""
