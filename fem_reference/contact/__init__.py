"""Unilateral contact of an elastic body with rigid tools of prescribed motion."""
