"""Checks: what the residuals of a fit show, and by how much the uncertainties must increase."""
