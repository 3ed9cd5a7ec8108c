"""The figures of the report page, one file a kind of result."""
