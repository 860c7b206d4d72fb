"""Hydra and OmegaConf: nothing else of infoplan knows of them."""
