"""The stages of the chain: records in, one record out; they know neither files nor printing."""
