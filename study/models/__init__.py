"""The models of a study, one file each, and the table that lists them."""
