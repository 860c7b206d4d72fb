"""Hydra configuration of infoplan."""
