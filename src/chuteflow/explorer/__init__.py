"""The explorer: one page, served on this machine, that answers while sliders move."""
