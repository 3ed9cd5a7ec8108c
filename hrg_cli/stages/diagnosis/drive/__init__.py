"""Diagnosis of driven runs: what a log of the drive leaves open of what the loops did."""
