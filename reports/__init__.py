"""From a results folder to a PDF: figures, tables and their document. Nothing is simulated here."""
