"""Small disturbances of steady flows in three dimensions: normal modes, their growth, what limits them."""
