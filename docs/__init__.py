"""The pages of the documentation, and what makes their generated parts."""
