"""Findings: stages yield codes and numbers, ``findings.toml`` has the words."""
