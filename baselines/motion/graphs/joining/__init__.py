"""How clips follow one another: joins, their price, and which may follow which."""
