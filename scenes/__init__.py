"""Scenes: where frames and labels come from (simulated, measured or recorded)."""
