"""Frames in and readings out: databases, roles, acceptance, E2E protection, codecs and units."""
