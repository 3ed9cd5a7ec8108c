"""Foreign logs: `import_log` makes a recording of any of them, `read_table` a plain table."""

from .envelope import import_envelope
from .importing import import_log
from .pairing import find_partners, find_second_file
from .table import read_table

__all__ = ["find_partners", "find_second_file", "import_envelope", "import_log", "read_table"]
