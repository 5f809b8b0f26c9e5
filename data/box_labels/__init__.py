"""Boxes as labelling tools write them: a reader a form, and the check of their axes against the scans."""
