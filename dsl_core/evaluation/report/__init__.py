"""Self-contained HTML reports, their pictures and curves."""
