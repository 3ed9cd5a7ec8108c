"""What people see: the terminal, pages, figures, tables, and the generated documentation."""
