"""The ledger: every result of every gyro in one SQLite file, and what a production line asks of it
(drift, charts, capability, gauge study, guard bands)."""
