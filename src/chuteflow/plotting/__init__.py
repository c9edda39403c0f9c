"""Pictures of results, and the style of all figures; matplotlib is imported when one is drawn."""
