"""The slow model with effects, and the evidence for causes in what it leaves."""
