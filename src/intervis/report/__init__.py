"""Results as people look at them: tables, pictures, pages."""
