"""Fuzzy estimates at the command line: of a patient, a table of patients, or a cohort."""
